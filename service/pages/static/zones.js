// Zones drawn by hand over the picture, as they are now; kept as GeoJSON in pixels.

import { Refused, announce, call, confirmed, guarded } from "./act.js";
import { refreshSoon } from "./camera.js";
import { corners, drags, shape, stepped } from "./pointing.js";
import { _ } from "./words.js";

const box = document.querySelector(".picture-box");
const form = document.getElementById("zoning");
const says = document.getElementById("zoning-says");
const { chosen: choice, name } = form.elements;
const over = document.getElementById("over");
const place = document.getElementById("over-zones");
const url = `/cameras/${encodeURIComponent(document.getElementById("camera").dataset.camera)}/zones?format=geojson`;
const { width, height } = over.viewBox.baseVal;
const resting = over.hasAttribute("hidden");
const KINDS = { zone: ["Polygon", "ground"], line: ["LineString", "ground"], mask: ["Polygon", "scene"] };
const CORNER_PX = 12; // of the screen: for a finger
const BESIDE = 0.1; // of the width, to the next corner of what has none yet

let drawing = null; // { collection, etag, zones }, while somebody draws
let chosen = null; // one of the zones
let fresh = false; // the chosen one is new: a tap adds its next corner
let held = -1; // the corner that is dragged
let changed = false;

const button = () => box.querySelector('[data-action="draw-zones"]');
const least = (zone) => (zone.line ? 2 : 3);
const index = (element) => Number(element.dataset.corner ?? -1);

/** A collection in pixels of this image, if it came in shares or in pixels of another stream. */
function inPixels({ size, normalised, ...collection }) {
  const [w, h] = normalised ? [1, 1] : (size ?? [width, height]);
  const from = normalised ? 0 : 0.5; // shares count from the edge, pixels from their centre
  const scaled = (at) => (Array.isArray(at[0]) ? at.map(scaled) : [((at[0] + from) * width) / w - 0.5, ((at[1] + from) * height) / h - 0.5]);
  if (normalised || size)
    for (const { geometry } of collection.features) geometry.coordinates = scaled(geometry.coordinates);
  return collection;
}

function zoneOf(feature) {
  const { type, coordinates } = feature.geometry;
  const { id, name: called } = feature.properties ?? {};
  const line = type === "LineString";
  return { feature, line, name: feature.id || id || called, points: line ? coordinates : coordinates[0].slice(0, -1) };
}

// --- What is seen ------------------------------------------------------------------------------

function show() {
  const focus = place.contains(document.activeElement) ? index(document.activeElement) : -1;
  place.replaceChildren();
  for (const zone of drawing.zones) {
    const kind = zone === chosen ? "zone now chosen" : "zone now";
    shape(place, zone.line ? "polyline" : "polygon", { class: kind, points: corners(zone.points) }).zone = zone;
    if (zone === chosen || !zone.points.length) continue;
    const [x, y] = zone.points[0];
    shape(place, "text", { class: "zone-name", x, y, "font-size": width / 48 }).textContent = zone.name;
  }
  const r = (CORNER_PX * width) / over.getBoundingClientRect().width;
  const points = chosen?.points ?? [];
  points.forEach(([u, v], n) => {
    const next = points[(n + 1) % points.length];
    if (!fresh && !chosen.line)
      shape(place, "circle", { class: "between", cx: (u + next[0]) / 2, cy: (v + next[1]) / 2, r: r * 0.7, "data-between": n });
  });
  points.forEach(([u, v], n) => {
    const label = _("Corner {n} of {name}, at {u} {v}", { n: n + 1, name: chosen.name, u, v });
    const said = { tabindex: 0, role: "button", "aria-label": label };
    shape(place, "circle", { class: "corner", cx: u, cy: v, r, "data-corner": n, ...said });
  });
  if (focus >= 0) focusOn(Math.min(focus, points.length - 1));
}

function focusOn(n) {
  (place.querySelector(`[data-corner="${n}"]`) ?? over).focus({ preventScroll: true });
}

function choose(zone, isNew = false) {
  [chosen, fresh, held] = [zone, isNew, -1];
  choice.replaceChildren(...drawing.zones.map((each) => new Option(each.name, "", false, each === zone)));
  name.value = zone?.name ?? "";
  for (const field of form.querySelectorAll("[data-of-one]")) field.hidden = !zone;
  show();
}

// --- Corners -----------------------------------------------------------------------------------

function put(n, at) {
  chosen.points[n] = at;
  changed = true;
  show();
}

function insert(n, at) {
  chosen.points.splice(n, 0, at);
  changed = true;
  if (chosen.line && chosen.points.length === 2) fresh = false;
  show();
  focusOn(n);
}

function press(at, target) {
  if (!drawing) return false;
  held = index(target);
  if (held === 0) {
    fresh = false; // where it began: it is closed
    show();
  }
  if (held < 0 && fresh) insert((held = chosen.points.length), at);
  else if (target.dataset.between) insert((held = Number(target.dataset.between) + 1), at);
  else if (held >= 0) focusOn(held);
  else if (target.zone) choose(target.zone);
  return held >= 0;
}

/** Add a corner by keyboard: beside the one before it, or halfway to the next. */
function add(n) {
  const { points, line } = chosen;
  if (line && points.length > 1) return announce(_("A line has two ends."));
  const from = points[n] ?? points.at(-1);
  if (!from) return insert(0, [width / 2, height / 2].map(Math.round));
  if (points.length > 2 && n >= 0) {
    const to = points[(n + 1) % points.length];
    return insert(n + 1, [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2].map(Math.round));
  }
  const far = BESIDE * width;
  const away = (value, size) => Math.round(value + (value > size / 2 ? -far : far));
  insert(points.length, points.length === 2 ? [from[0], away(from[1], height)] : [away(from[0], width), from[1]]);
}

function takeAway(n) {
  if (chosen.points.length <= least(chosen) && !fresh)
    return announce(chosen.line ? _("A line has two ends: remove it as a whole.") : _("A zone has three corners or more: remove it as a whole."));
  chosen.points.splice(n, 1);
  changed = true;
  show();
  focusOn(Math.max(n - 1, 0));
}

function key(event) {
  if (!drawing || event.defaultPrevented) return;
  if (event.key === "Escape") {
    event.preventDefault(); // it would close what asks
    return leave();
  }
  if (!chosen || !over.contains(event.target)) return;
  const n = index(event.target);
  const at = n >= 0 && stepped(event, chosen.points[n], over);
  if (at) put(n, at);
  else if (event.key === "Enter") add(n);
  else if (["Delete", "Backspace"].includes(event.key) && n >= 0) takeAway(n);
  else return;
  event.preventDefault();
}

// --- Zones -------------------------------------------------------------------------------------

function begin(kind) {
  const [type, on] = KINDS[kind];
  const taken = new Set(drawing.zones.map((zone) => zone.name));
  let number = 1;
  const called = { zone: _("zone"), line: _("line"), mask: _("mask") }[kind];
  while (taken.has(`${called} ${number}`)) number++;
  const feature = { type: "Feature", id: `${called} ${number}`, properties: { on }, geometry: { type, coordinates: [[]] } };
  drawing.zones.push({ feature, line: kind === "line", name: feature.id, points: [] });
  changed = true;
  choose(drawing.zones.at(-1), true);
  over.focus({ preventScroll: true });
}

function remove() {
  drawing.zones.splice(drawing.zones.indexOf(chosen), 1);
  changed = true;
  choose(drawing.zones.at(-1) ?? null);
  form.querySelector("[data-new]").focus();
}

/** Draw, from what is kept: where it is by the pose that holds now. */
async function enter({ dataset }) {
  const answer = await fetch(url, { headers: { Accept: "application/geo+json" } });
  if (!answer.ok) throw new Refused(await answer.json());
  const collection = inPixels(await answer.json());
  drawing = { collection, etag: answer.headers.get("ETag"), zones: collection.features.map(zoneOf) };
  const lost = Number(dataset.zones) - drawing.zones.length;
  says.textContent = lost > 0 ? _("{n} of the zones cannot be drawn where they are now, and would be gone once you save.", { n: lost }) : "";
  changed = false;
  box.classList.add("zoning");
  form.hidden = false;
  over.removeAttribute("hidden");
  over.setAttribute("tabindex", 0);
  choose(drawing.zones[0] ?? null);
  form.querySelector("[data-new]").focus();
}

async function leave() {
  const detail = _("What you have drawn is not kept.");
  if (changed && !(await confirmed({ title: _("Leave without saving?"), detail, yes: _("Leave") }))) return;
  drawing = chosen = null;
  changed = false;
  place.replaceChildren();
  box.classList.remove("zoning");
  form.hidden = true;
  over.toggleAttribute("hidden", resting);
  over.removeAttribute("tabindex");
  button()?.focus();
}

async function save() {
  says.textContent = "";
  const unfinished = drawing.zones.find((zone) => zone.points.length < least(zone));
  if (unfinished) {
    choose(unfinished, true);
    says.textContent = _("{name} has too few corners: {n} are needed.", { name: unfinished.name, n: least(unfinished) });
    return;
  }
  for (const { feature, line, name: called, points } of drawing.zones) {
    feature.id = called;
    feature.geometry.coordinates = line ? points : [[...points, points[0]]];
  }
  drawing.collection.features = drawing.zones.map((zone) => zone.feature);
  try {
    await call("PUT", url, drawing.collection, { "If-Match": drawing.etag });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    says.textContent = error.reason;
    return; // what was drawn stays
  }
  announce(_("The zones are kept, as drawn at the pose of now."));
  changed = false;
  button().dataset.zones = drawing.zones.length; // until the page says so
  await leave();
  refreshSoon();
}

drags(over, press, (at) => put(held, at));
box.addEventListener("keydown", key);
box.addEventListener("click", ({ target }) => {
  const pressed = target.closest("button");
  const { action, new: kind, zoning } = pressed?.dataset ?? {};
  if (action === "draw-zones") guarded(pressed, () => enter(pressed));
  else if (kind) begin(kind);
  else if (zoning === "remove") remove();
  else if (zoning === "leave") leave();
});
form.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(form.querySelector('[type="submit"]'), save);
});
choice.addEventListener("change", () => choose(drawing.zones[choice.selectedIndex]));
name.addEventListener("input", () => {
  chosen.name = choice.selectedOptions[0].textContent = name.value;
  changed = true;
});
window.addEventListener("resize", () => drawing && show());
window.addEventListener("beforeunload", (event) => changed && event.preventDefault());
