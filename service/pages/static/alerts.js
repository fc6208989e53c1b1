// All alerts: answered in their lines, or many at once; what happens is fetched anew.

import { announce, guarded } from "./act.js";
import { ALERT_ACTS, listen, planMaintenance, silenceOf } from "./alert_acts.js";
import { actOn } from "./bulk_acts.js";
import { ask } from "./dialogs.js";
import { gathered, subscribe } from "./events.js";
import { keepTimes } from "./times.js";

const list = document.getElementById("alerts");
const bulk = document.getElementById("bulk");

const picked = () => [...list.querySelectorAll(".pick:checked")].map((box) => box.closest("li"));

/** Offer what can be done with all that are chosen. */
function offer() {
  if (!bulk) return;
  const rows = picked();
  bulk.hidden = !rows.length;
  document.getElementById("chosen").textContent = rows.length === 1 ? "1 alert" : `${rows.length} alerts`;
  for (const button of bulk.querySelectorAll("[data-outcome]")) {
    button.hidden = !rows.every((row) => row.dataset.outcomes.split(" ").includes(button.dataset.outcome));
  }
  bulk.querySelector('[data-bulk="maintenance"]').hidden = !rows.every((row) => row.dataset.camera);
  const all = document.getElementById("all");
  const boxes = list.querySelectorAll(".pick").length;
  if (all) all.checked = boxes > 0 && rows.length === boxes;
}

/** The list as it is now; what was chosen stays chosen, and the focus where it was. */
async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" } });
  if (!answer.ok || answer.redirected) return;
  const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
  const kept = new Set(picked().map((row) => row.id));
  const held = document.activeElement?.closest?.("li.alert-row")?.id;
  list.replaceChildren(...fresh.getElementById("alerts").childNodes);
  list.dispatchEvent(new Event("renewed"));
  document.title = fresh.title;
  for (const id of kept) {
    const box = document.querySelector(`#${CSS.escape(id)} .pick`);
    if (box) box.checked = true;
  }
  if (held) (document.querySelector(`#${CSS.escape(held)} .pick`) ?? document.getElementById("main")).focus({ preventScroll: true });
  offer();
}

const ids = (of) => [...new Set(picked().map(of))];

/** Choose nothing any more, once it was done. */
async function withAll(act, more, of = (row) => row.dataset.id) {
  const items = await actOn(act, ids(of), more);
  if (items === undefined) return undefined;
  for (const box of list.querySelectorAll(".pick")) box.checked = false;
  offer();
  return items;
}

const BULK = {
  resolve: ({ outcome }) => withAll("resolve", { outcome }),
  acknowledge: () => withAll("acknowledge"),
  silence: () => ask("silence-dialog", { send: (said) => withAll("silence", silenceOf(said)) }),
  maintenance: () => planMaintenance((body) => withAll("maintenance", body, (row) => row.dataset.camera)),
};

bulk?.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-bulk]");
  if (button) guarded(button, () => BULK[button.dataset.bulk](button.dataset));
});
list.addEventListener("change", (event) => {
  if (event.target.id === "all") {
    for (const box of list.querySelectorAll(".pick")) box.checked = event.target.checked;
  }
  offer();
});
listen(list, ALERT_ACTS);
const again = () => refresh().catch(console.warn);
document.addEventListener("acted", again);
subscribe(
  ((soon) => (event) => event.type === "alert" && soon(event))(
    gathered((events) => {
      again();
      const news = events.findLast(({ data }) => data.message === "alert.opened");
      if (news) announce(`A new alert: ${news.data.camera_id ?? news.data.track_source}`);
    }, 300),
  ),
);
keepTimes(list);
