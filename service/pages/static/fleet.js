// The fleet as it is now: an index of all cameras that is sifted and sorted here, and a page of rows,
// which are fetched; rows that something happened to are fetched anew.

import { announce, call, guarded } from "./act.js";
import { ALERT_ACTIONS, done, listen } from "./alert_actions.js";
import { answer, offer, undoneHere, withMany } from "./bulk_actions.js";
import { signed } from "./dialogs.js";
import { gathered, subscribe } from "./events.js";
import { placed, showPlaces, within } from "./places.js";
import { keepTimes } from "./times.js";
import { _, _n } from "./words.js";

const list = document.getElementById("rows");
const search = document.getElementById("search");
const sort = document.getElementById("sort");
const bulk = document.getElementById("bulk");
const all = document.getElementById("all");
const pager = document.getElementById("pager");
const chips = [...document.querySelectorAll(".chip")];
const found = document.getElementById("found");
const none = document.getElementById("none");
const due = document.getElementById("due");
const places = document.getElementById("places");
const plainTitle = document.title.replace(/^\(\d+\) /, "");
const PAGE = Number(list.dataset.page);
const MOST_IDS = 100; // more in one address is too long
const ALL_AGAIN_MS = 120_000; // states that time alone changes
const CALM = 6; // from this rank on it does not matter since when (fleet_index.py)
const CALLED_OUT = ["alert.opened", "alert.updated"];
const WORDS = Object.fromEntries(chips.map((chip) => [chip.dataset.state, chip.dataset.word]));

const index = new Map(); // what the service says of each camera
const rows = new Map(); // the rows that have been fetched, by id
const chosen = new Set();
let states = new Set();
const chosenPlace = { site: "", tags: new Set() };
let page = 0;
let wanted = []; // the ids of this page

/** A name as it is sorted by: gate 2 comes before gate 10 (fleet_index.py). */
const sortable = (name) => name.toLowerCase().replace(/[0-9]+/g, (digits) => digits.padStart(9, "0"));

/** Take a line of the index; a row says its place itself, the index by its number. */
function note([id, name, state, rank, waiting, since, fresh, last, words, kinds, at], told = []) {
  const place = told[at] ?? at;
  const text = () => `${name} ${id} ${WORDS[state]} ${words} ${place}`.toLowerCase();
  index.set(id, { id, name: sortable(name), state, rank, waiting, since, fresh, last, text, kinds, ...placed(place) });
}

const noteAll = (told) => told.cameras.forEach((line) => note(line, told.places));

const byName = (a, b) => (a.name < b.name ? -1 : a.name > b.name ? 1 : a.id < b.id ? -1 : 1);
const kindOf = ({ state }) => (state === "drifting" ? "" : state); // moves first
const byKind = (a, b) => (kindOf(a) < kindOf(b) ? -1 : Number(kindOf(a) > kindOf(b)));
const ORDERS = {
  "": (a, b) => a.rank - b.rank || (a.rank < CALM ? byKind(a, b) || b.since - a.since : 0) || byName(a, b),
  name: byName,
  since: (a, b) => b.since - a.since || byName(a, b),
  last: (a, b) => (a.last ?? 0) - (b.last ?? 0) || byName(a, b),
  site: (a, b) => (a.site < b.site ? -1 : a.site > b.site ? 1 : ORDERS[""](a, b)),
};

/** The cameras of the site and tags that are asked for. */
const here = () => [...index.values()].filter((camera) => within(camera, chosenPlace));

const has = (text, words) => words.every((word) => text.includes(word));

/** The cameras that are asked for, in their order. */
function matching() {
  const words = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
  const fits = ({ state, text }) => (!states.size || states.has(state)) && (!words.length || has(text(), words));
  return here().filter(fits).sort(ORDERS[sort.value] ?? ORDERS[""]);
}

/** Show the page that is asked for, and how many there are of each state. */
async function show() {
  const cameras = matching();
  page = Math.min(page, Math.max(Math.ceil(cameras.length / PAGE) - 1, 0));
  const mine = (wanted = cameras.slice(page * PAGE, (page + 1) * PAGE).map(({ id }) => id));
  say(cameras);
  const lacking = mine.filter((id) => !rows.has(id));
  if (lacking.length) await fetchRows(lacking);
  if (mine !== wanted) return; // another page is asked for by now
  const held = document.activeElement?.closest?.("li.row");
  const what = held && (document.activeElement.matches(".pick") ? ".pick" : "a");
  const now = mine.map((id) => rows.get(id)).filter(Boolean);
  if (now.length !== list.children.length || now.some((row, at) => row !== list.children[at])) list.replaceChildren(...now);
  if (held && !list.contains(document.activeElement)) {
    (document.querySelector(`#row-${CSS.escape(held.dataset.id)} ${what}`) ?? list).focus({ preventScroll: true });
  }
}

function say(cameras) {
  const counts = {};
  const groups = [...document.querySelectorAll("#banners [data-waiting='1']")].map((each) => _("{group} as one", { group: each.dataset.name }));
  let waiting = groups.length;
  for (const { waiting: its } of index.values()) waiting += its;
  for (const { state } of here()) counts[state] = (counts[state] ?? 0) + 1;
  showPlaces(places, [...index.values()], chosenPlace);
  for (const chip of chips) {
    const count = counts[chip.dataset.state] ?? 0;
    chip.querySelector("b").textContent = count;
    chip.classList.toggle("empty-state", !count);
    chip.setAttribute("aria-pressed", String(states.has(chip.dataset.state)));
  }
  due.textContent = waiting ? [_n("{n} needs a person", "{n} need a person", waiting), ...groups].join(", ") : index.size ? _("Nothing needs a person") : "";
  document.title = (waiting ? `(${waiting}) ` : "") + plainTitle;
  none.hidden = cameras.length > 0;
  if (index.size) none.textContent = _("No camera is like that.");
  found.textContent = _n("{n} camera", "{n} cameras", cameras.length);
  pager.hidden = cameras.length <= PAGE;
  const last = Math.min((page + 1) * PAGE, cameras.length);
  document.getElementById("shown").textContent = _("{first} to {last} of {all}", { first: page * PAGE + 1, last, all: cameras.length });
  document.getElementById("back").disabled = page === 0;
  document.getElementById("forth").disabled = last === cameras.length;
  if (!bulk) return;
  for (const id of chosen) if (!index.has(id)) chosen.delete(id);
  offer(bulk, chosenOnes(), "camera");
  all.checked = cameras.length > 0 && cameras.every(({ id }) => chosen.has(id));
}

/** Show what is asked for by now, from its first page on, and keep it in the address. */
function ask() {
  page = 0;
  keepAddress();
  show().catch(console.warn);
}

function keepAddress() {
  const query = new URLSearchParams();
  if (search.value.trim()) query.set("q", search.value.trim());
  if (chosenPlace.site) query.set("site", chosenPlace.site);
  for (const tag of chosenPlace.tags) query.append("tag", tag);
  for (const state of states) query.append("state", state);
  if (sort.value) query.set("sort", sort.value);
  if (page) query.set("page", page + 1);
  history.replaceState(null, "", query.size ? `?${query}` : location.pathname);
}

async function fragment(url) {
  const answer = await fetch(url, { headers: { Accept: "text/html" } });
  if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
  const holder = document.createElement("template");
  holder.innerHTML = await answer.text();
  return holder.content;
}

/** Take rows as they were told, and what they say of their cameras. */
function keep(fresh) {
  for (const row of fresh) {
    const box = row.querySelector(".pick");
    if (box) box.checked = chosen.has(row.dataset.id);
    rows.set(row.dataset.id, row);
    note(JSON.parse(row.dataset.line));
  }
}

async function fetchRows(ids) {
  for (let at = 0; at < ids.length; at += MOST_IDS) {
    const some = ids.slice(at, at + MOST_IDS);
    const content = await fragment(`/ui/fleet/rows?ids=${some.map(encodeURIComponent).join(",")}`);
    const fresh = [...content.querySelectorAll("li.row")];
    for (const id of some) {
      rows.delete(id);
      index.delete(id); // unless it is still told of
    }
    keep(fresh);
  }
}

async function fetchAll() {
  const told = await call("GET", "/ui/fleet/index");
  index.clear();
  noteAll(told);
  rows.clear();
  await show();
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
    for (const id of ids) rows.get(id)?.classList.add("fresh");
    await show();
  } catch (error) {
    console.warn(error); // the next event or the next look at all comes soon
    return;
  }
  // What somebody has done with an alert is seen, and is no news to call out.
  const alert = events.findLast(({ data }) => CALLED_OUT.includes(data.message) && !undoneHere(data));
  if (alert) announce(wordsOf(alert.data));
}

function wordsOf(alert) {
  if (!alert.camera_id) return document.querySelector(`#banner-${CSS.escape(alert.id)} p`)?.textContent ?? "";
  const row = rows.get(alert.camera_id);
  if (!row) return "";
  return `${row.querySelector(".who a").textContent}: ${row.querySelector(".words").textContent}`;
}

const soon = gathered(look, 100);
const later = gathered(look, 1000);
subscribe((event) => (event.type === "alert" ? soon(event) : later(event)));
setInterval(() => document.hidden || Promise.all([fetchAll(), fetchBanners()]).catch(console.warn), ALL_AGAIN_MS);
keepTimes(list, document.getElementById("banners"));
listen(document.getElementById("banners"), {
  ...ALERT_ACTIONS,
  answer: (said, button) => answer({ ...said, name: button.closest(".banner").dataset.name }),
  async "take-over"({ handover }) {
    await done(_("Taken over."), signed("POST", `/handovers/${handover}/take`));
    await fetchBanners();
  },
});

search.addEventListener("input", ask);
search.form.addEventListener("submit", (event) => event.preventDefault());
sort.addEventListener("change", ask);
for (const chip of chips) {
  chip.addEventListener("click", () => {
    if (!states.delete(chip.dataset.state)) states.add(chip.dataset.state);
    ask();
  });
}
places.addEventListener("click", ({ target }) => {
  const { site, tag } = target.closest("button")?.dataset ?? {};
  if (site !== undefined) chosenPlace.site = site;
  if (tag !== undefined && !chosenPlace.tags.delete(tag)) chosenPlace.tags.add(tag);
  ask();
});
for (const [id, by] of [["back", -1], ["forth", 1]]) {
  document.getElementById(id).addEventListener("click", async () => {
    page += by;
    keepAddress();
    await show();
    list.scrollIntoView({ block: "start" });
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
    ask();
  }
});

// --- Many at once ------------------------------------------------------------------------------

function choose(ids, on) {
  for (const id of ids) {
    if (on) chosen.add(id);
    else chosen.delete(id);
    const box = rows.get(id)?.querySelector(".pick");
    if (box) box.checked = on;
  }
  say(matching());
}

const chosenOnes = () =>
  [...chosen].map((camera) => ({
    camera,
    kinds: index.get(camera).kinds,
    waiting: index.get(camera).waiting,
    fresh: index.get(camera).fresh,
    name: rows.get(camera)?.querySelector(".who a").textContent ?? camera,
  }));

list.addEventListener("change", ({ target }) => target.matches(".pick") && choose([target.closest("li").dataset.id], target.checked));
all?.addEventListener("change", () => choose(matching().map(({ id }) => id), all.checked));
document.getElementById("none-chosen")?.addEventListener("click", () => choose([...chosen], false));
bulk?.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-bulk]");
  if (button) guarded(button, () => withMany(button.dataset, chosenOnes(), () => choose([...chosen], false)));
});

noteAll(JSON.parse(document.getElementById("index").textContent));
keep(list.querySelectorAll("li.row"));
const asked = new URLSearchParams(location.search);
search.value = asked.get("q") ?? "";
sort.value = asked.get("sort") ?? "";
states = new Set(asked.getAll("state").filter((state) => state in WORDS));
chosenPlace.site = asked.get("site") ?? "";
chosenPlace.tags = new Set(asked.getAll("tag"));
page = Math.max(Number(asked.get("page") ?? 1) - 1 || 0, 0);
show().catch(console.warn);
performance.mark("usable"); // for tests.benchmarks.fleet
