// The fleet as it is now: rows that something happened to are fetched anew, the others stay.

import { announce } from "./act.js";
import { ALERT_ACTS, listen } from "./alert_acts.js";
import { gathered, subscribe } from "./events.js";
import { keepTimes } from "./times.js";

const list = document.getElementById("rows");
const search = document.getElementById("search");
const chips = [...document.querySelectorAll(".chip")];
const found = document.getElementById("found");
const none = document.getElementById("none");
const plainTitle = document.title.replace(/^\(\d+\) /, "");
const MOST_IDS = 100; // more in one address is too long; then all are fetched
const ALL_AGAIN_MS = 120_000; // states that time alone changes

const CALLED_OUT = ["alert.opened", "alert.updated"];

let state = "";

/** Show the rows that are asked for, and how many there are of each state. */
function sift() {
  const words = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
  const counts = {};
  let shown = 0;
  for (const row of list.children) {
    const { state: its, text } = row.dataset;
    counts[its] = (counts[its] ?? 0) + 1;
    row.hidden = (state && its !== state) || !words.every((word) => text.includes(word));
    if (!row.hidden) shown += 1;
  }
  for (const chip of chips) {
    const count = counts[chip.dataset.state] ?? 0;
    chip.querySelector("b").textContent = count;
    chip.classList.toggle("empty-state", !count);
    chip.setAttribute("aria-pressed", String(chip.dataset.state === state));
  }
  const waiting = [...document.querySelectorAll("[data-waiting]")].reduce((sum, each) => sum + Number(each.dataset.waiting), 0);
  document.title = (waiting ? `(${waiting}) ` : "") + plainTitle;
  none.hidden = shown > 0;
  if (!shown && list.children.length) none.textContent = "No camera is like that.";
  return shown;
}

function siftAndSay() {
  const shown = sift();
  found.textContent = shown === 1 ? "1 camera" : `${shown} cameras`;
  const query = new URLSearchParams();
  if (search.value.trim()) query.set("q", search.value.trim());
  if (state) query.set("state", state);
  history.replaceState(null, "", query.size ? `?${query}` : location.pathname);
}

/** Put rows where they belong by their keys, in place of those asked for, or of all. */
function place(fresh, asked) {
  const held = document.activeElement?.closest?.("li.row")?.dataset.id;
  if (!asked) {
    list.replaceChildren(...fresh);
  } else {
    for (const id of asked) document.getElementById(`row-${id}`)?.remove();
    for (const row of fresh) {
      row.classList.add("fresh");
      const after = [...list.children].find((other) => other.dataset.key > row.dataset.key);
      list.insertBefore(row, after ?? null);
    }
  }
  if (held && !list.contains(document.activeElement)) {
    document.querySelector(`#row-${CSS.escape(held)} a`)?.focus({ preventScroll: true });
  }
  sift();
}

async function fragment(url) {
  const answer = await fetch(url, { headers: { Accept: "text/html" } });
  if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
  const holder = document.createElement("template");
  holder.innerHTML = await answer.text();
  return holder.content;
}

async function fetchRows(ids) {
  const some = ids && ids.length <= MOST_IDS ? ids : null;
  const query = some ? `?ids=${some.map(encodeURIComponent).join(",")}` : "";
  const content = await fragment(`/ui/fleet/rows${query}`);
  place([...content.querySelectorAll("li.row")], some);
}

async function fetchBanners() {
  document.getElementById("banners").replaceChildren(await fragment("/ui/fleet/banners"));
}

/** Fetch what some events are about. */
async function look(events) {
  const ids = new Set();
  // Cameras join a group without a word of the group's own.
  let banners = Boolean(document.querySelector("#banners .banner"));
  for (const { data } of events) {
    if (data.camera_id) ids.add(data.camera_id);
    for (const id of data.camera_ids ?? []) ids.add(id);
    banners ||= Boolean(data.camera_ids || data.group_id);
  }
  try {
    await Promise.all([ids.size ? fetchRows([...ids]) : null, banners ? fetchBanners() : null]);
  } catch (error) {
    console.warn(error); // the next event or the next look at all comes soon
    return;
  }
  sift();
  // What somebody has done with an alert is seen, and is no news to call out.
  const alert = events.findLast(({ data }) => CALLED_OUT.includes(data.message));
  if (alert) announce(wordsOf(alert.data));
}

function wordsOf(alert) {
  if (!alert.camera_id) return alert.reason;
  const row = document.getElementById(`row-${alert.camera_id}`);
  if (!row) return "";
  return `${row.querySelector(".who a").textContent}: ${row.querySelector(".words").textContent}`;
}

const soon = gathered(look, 100);
const later = gathered(look, 1000);
subscribe((event) => (event.type === "alert" ? soon(event) : later(event)));
setInterval(() => document.hidden || fetchRows(null).catch(console.warn), ALL_AGAIN_MS);
keepTimes(list, document.getElementById("banners"));
listen(document.getElementById("banners"), ALERT_ACTS);

search.addEventListener("input", siftAndSay);
search.form.addEventListener("submit", (event) => event.preventDefault());
for (const chip of chips) {
  chip.addEventListener("click", () => {
    state = state === chip.dataset.state ? "" : chip.dataset.state;
    siftAndSay();
  });
}
document.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("input, textarea, select, dialog");
  if (event.key === "/" && !typing && !event.ctrlKey && !event.metaKey) {
    event.preventDefault();
    search.focus();
  }
  if (event.key === "Escape" && event.target === search) {
    search.value = "";
    siftAndSay();
  }
});

const asked = new URLSearchParams(location.search);
search.value = asked.get("q") ?? "";
state = chips.some((chip) => chip.dataset.state === asked.get("state")) ? asked.get("state") : "";
sift();
performance.mark("usable"); // for tests.benchmarks.fleet
