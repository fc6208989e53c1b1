// A plan or an aerial picture: measured, kept, and pointed at for the metres of a map point.

import { Refused, announce, call, confirmed, guarded } from "./act.js";
import { drags, drawMarks, stepped } from "./pointing.js";
import { _ } from "./words.js";

const svg = document.getElementById("site-plan");
const image = svg.querySelector("image");
const form = document.getElementById("plan-form");
const says = document.getElementById("plan-says");
const file = document.getElementById("plan-file");
const remove = document.getElementById("plan-remove");
const url = `/cameras/${encodeURIComponent(document.getElementById("camera").dataset.camera)}/plan`;
const { length_m, metres_per_pixel, north_deg } = form.elements;
const MAP_M = 0.1, POINTED_PX = 2; // how well a map and a hand are taken to be known

let plan = JSON.parse(svg.dataset.plan);
let measured = null; // a file that is not kept yet: `ruler` is the line drawn on it
let marks = { kept: [], spot: null };

const number = ({ value }) => Number(value.replace(",", "."));

/** Metres east and north of the lower left corner, of a pixel; and the way back. */
function metres([p, q]) {
  const [right, up] = [p + 0.5, plan.height - 0.5 - q].map((far) => far * plan.metres_per_pixel);
  const [c, s] = turn();
  return [right * c - up * s, right * s + up * c];
}

function pixelOf([x, y]) {
  const [c, s] = turn();
  const [right, up] = [x * c + y * s, y * c - x * s].map((far) => far / plan.metres_per_pixel);
  return [right - 0.5, plan.height - 0.5 - up];
}

const turn = () => [Math.cos, Math.sin].map((of) => of((plan.north_deg * Math.PI) / 180));

function show() {
  const place = svg.querySelector("g");
  if (measured) return drawMarks(place, [{ points: measured.ruler, made: true }]);
  if (!plan) return;
  const known = marks.kept.map(({ x_m, y_m }, n) => ({ points: x_m === null ? [] : [pixelOf([x_m, y_m])], label: marks.label(n) }));
  drawMarks(place, [...known, { points: marks.spot ? [pixelOf(marks.spot)] : [], made: true }]);
}

/** Lay a picture under the marks; null is none. */
function lay(href, { width, height } = {}) {
  svg.toggleAttribute("hidden", !href);
  if (!href) return;
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
  for (const [name, value] of Object.entries({ href, x: -0.5, y: -0.5, width, height })) image.setAttribute(name, value);
  show();
}

function layPlan() {
  measured = null;
  form.hidden = true;
  remove.hidden = !plan;
  lay(plan && `${url}?v=${plan.sha256.slice(0, 12)}`, plan ?? {});
}

function press(at) {
  if (measured) measured.ruler = [at];
  else point(at);
  show();
}

function drag(at) {
  if (!measured) return point(at);
  measured.ruler[1] = at;
  measure();
}

function point(at) {
  const [x_m, y_m] = metres(at).map((value) => value.toFixed(3));
  const sd_m = Math.min(Math.max(MAP_M, POINTED_PX * plan.metres_per_pixel), 100).toFixed(3);
  document.dispatchEvent(new CustomEvent("plan-place", { detail: { x_m, y_m, sd_m } }));
}

function measure() {
  const [from, to] = measured.ruler;
  const far = to && Math.hypot(to[0] - from[0], to[1] - from[1]);
  if (far && number(length_m) > 0) metres_per_pixel.value = (number(length_m) / far).toPrecision(4);
  show();
}

async function choose() {
  const [chosen] = file.files;
  if (!chosen) return;
  says.textContent = "";
  const read = new FileReader();
  const href = await new Promise((done) => {
    read.onloadend = () => done(read.result);
    read.readAsDataURL(chosen);
  });
  const seen = new Image();
  seen.src = href;
  try {
    await seen.decode();
  } catch {
    says.textContent = _("That is no JPEG and no PNG.");
    return;
  }
  measured = { file: chosen, ruler: [] };
  form.hidden = false;
  lay(href, { width: seen.naturalWidth, height: seen.naturalHeight });
  length_m.focus();
}

async function keep() {
  says.textContent = "";
  const query = new URLSearchParams({ metres_per_pixel: number(metres_per_pixel), north_deg: number(north_deg) });
  try {
    plan = await call("PUT", `${url}?${query}`, measured.file);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    const [{ pointer = "", reason } = {}] = error.problem.errors ?? [];
    says.textContent = reason ? `${pointer.slice(1)}: ${reason}` : error.message;
    return; // what was measured stays
  }
  announce(_("The plan is kept."));
  layPlan();
  svg.focus();
}

drags(svg, press, drag);
svg.addEventListener("keydown", (event) => {
  const { width, height } = svg.viewBox.baseVal;
  const from = marks.spot ? pixelOf(marks.spot) : [width / 2, height / 2];
  const at = !measured && stepped(event, from, svg);
  if (at) point(at);
});
file.addEventListener("click", () => (file.value = "")); // one that was mended is news, too
file.addEventListener("change", () => guarded(file, choose));
length_m.addEventListener("input", measure);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(form.querySelector("button"), keep);
});
remove.addEventListener("click", () =>
  guarded(remove, async () => {
    const detail = _("Marks that were made by it stay.");
    if (!(await confirmed({ title: _("Delete the plan?"), detail, yes: _("Delete it") }))) return;
    await call("DELETE", url);
    plan = null;
    layPlan();
    file.focus();
  }),
);
document.addEventListener("marks", ({ detail }) => {
  marks = detail;
  show();
});
layPlan();
