// All alerts: answered in their lines, or many at once; what happens is fetched anew.

import { announce, guarded } from "./act.js";
import { ALERT_ACTIONS, listen } from "./alert_actions.js";
import { answer, offer as offerFor, undoneHere, withMany } from "./bulk_actions.js";
import { gathered, subscribe } from "./events.js";
import { keepTimes } from "./times.js";
import { _ } from "./words.js";

const list = document.getElementById("alerts");
const bulk = document.getElementById("bulk");

const picked = () => [...list.querySelectorAll(".pick:checked")].map((box) => box.closest("li"));

const itemOf = (row) => ({ ...row.dataset, alert: row.dataset.id, name: row.querySelector(".who").textContent });

/** Offer what can be done with all that are chosen. */
function offer() {
  if (!bulk) return;
  const rows = picked();
  offerFor(bulk, rows.map(itemOf), "alert");
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
  const active = document.activeElement;
  // A button that waits for its answer is disabled, and has lost the focus.
  const focused = list.contains(active) ? active : active === document.body ? list.querySelector("button[aria-busy]") : null;
  const held = focused?.closest("li.alert-row");
  const at = [...list.querySelectorAll("li.alert-row")].indexOf(held);
  list.replaceChildren(...fresh.getElementById("alerts").childNodes);
  list.dispatchEvent(new Event("renewed"));
  document.title = fresh.title;
  for (const id of kept) {
    const box = document.querySelector(`#${CSS.escape(id)} .pick`);
    if (box) box.checked = true;
  }
  if (focused) {
    // On the same alert, or the next one where it has gone.
    const now = [...list.querySelectorAll("li.alert-row")];
    const row = held && (now.find(({ id }) => id === held.id) ?? now[Math.min(at, now.length - 1)]);
    const again = row?.querySelector(".pick, a") ?? document.getElementById(focused.id || "rows");
    (again ?? document.getElementById("rows")).focus({ preventScroll: true });
  }
  offer();
}

function chooseNone() {
  for (const box of list.querySelectorAll(".pick")) box.checked = false;
  offer();
}

document.getElementById("none-chosen")?.addEventListener("click", chooseNone);
bulk?.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-bulk]");
  if (button) guarded(button, () => withMany(button.dataset, picked().map(itemOf), chooseNone));
});
list.addEventListener("change", (event) => {
  if (event.target.id === "all") {
    for (const box of list.querySelectorAll(".pick")) box.checked = event.target.checked;
  }
  offer();
});
listen(list, { ...ALERT_ACTIONS, answer: (said, button) => answer({ ...said, name: itemOf(button.closest("li")).name }) });
const again = () => refresh().catch(console.warn);
document.addEventListener("acted", again);
subscribe(
  ((soon) => (event) => event.type === "alert" && soon(event))(
    gathered((events) => {
      again();
      const news = events.findLast(({ data }) => data.message === "alert.opened" && !undoneHere(data));
      if (news) announce(_("A new alert: {name}", { name: news.data.camera_id ?? news.data.track_source }));
    }, 300),
  ),
);
keepTimes(list);
