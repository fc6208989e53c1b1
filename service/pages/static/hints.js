// Marks in the picture of a camera that nobody has calibrated: drawn or typed, kept, taken back.

import { announce, call, guarded, Refused } from "./act.js";
import { refreshSoon } from "./camera.js";

const form = document.getElementById("hint");
const list = document.getElementById("hint-list");
const says = document.getElementById("hint-says");
const camera = document.getElementById("camera").dataset.camera;
const url = `/cameras/${encodeURIComponent(camera)}/hints`;
const NAMES = { vertical: "Vertical", length: "Length", horizon: "Horizon", map_point: "Map point" };
const LIES = 3; // standard deviations, from which on a mark is doubted
const NEAR_PX = 3; // of the screen: a tap, and no line

let kept = [];

// --- Drawing -----------------------------------------------------------------------------------

const picture = () => document.querySelector('[data-part="picture"] svg.picture');

/** The pixel of the camera's picture that an event is at. */
function pixel(event, svg) {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [at.x, at.y].map((value) => Math.round(value * 10) / 10);
}

const typed = ([u, v]) => `${u} ${v}`;
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);

let begun = null;

function down(event) {
  const svg = event.target.closest?.("svg.picture");
  if (!svg || svg !== picture() || event.button > 0) return;
  event.preventDefault(); // a finger draws, and does not scroll
  begun = { svg, at: [event.clientX, event.clientY] };
  svg.setPointerCapture(event.pointerId);
  form.elements.from.value = typed(pixel(event, svg));
  form.elements.to.value = "";
  show();
}

function move(event) {
  if (!begun) return;
  const far = Math.hypot(event.clientX - begun.at[0], event.clientY - begun.at[1]);
  if (far < NEAR_PX || form.elements.kind.value === "map_point") return;
  form.elements.to.value = typed(pixel(event, begun.svg));
  show();
}

/** Draw the marks, and the one that is being made. */
function show() {
  const svg = picture();
  if (!svg) return;
  for (const old of svg.querySelectorAll(".mark")) old.remove();
  const made = ["from", "to"].map((name) => numbers(form.elements[name].value)).filter((at) => at.length === 2);
  for (const points of [...kept.map((mark) => mark.points), made]) {
    if (!points.length) continue;
    const line = document.createElementNS(svg.namespaceURI, "polyline");
    line.setAttribute("class", points === made ? "mark new" : "mark");
    const end = points[1] ?? [points[0][0] + 0.1, points[0][1]];
    line.setAttribute("points", [points[0], end].map((at) => at.join(",")).join(" "));
    svg.append(line);
  }
}

// --- Keeping -----------------------------------------------------------------------------------

function row(mark, number) {
  const item = document.createElement("li");
  const words = document.createElement("span");
  const size = mark.length_m ? ` of ${mark.length_m} m` : "";
  const lies = mark.off_sd > LIES ? ": it does not fit the others" : "";
  words.textContent = `${NAMES[mark.kind]}${size}${lies}`;
  const button = document.createElement("button");
  button.type = "button";
  button.className = "slim";
  button.textContent = "Take back";
  button.setAttribute("aria-label", `Take back: ${words.textContent}`);
  button.addEventListener("click", () => guarded(button, () => keep(kept.filter((_, at) => at !== number))));
  item.className = "row";
  item.append(words, button);
  return item;
}

function told(answer) {
  kept = answer.items;
  list.replaceChildren(...kept.map(row));
  show();
}

const bare = ({ off_sd: _, ...mark }) => Object.fromEntries(Object.entries(mark).filter(([, value]) => value !== null));

async function keep(marks) {
  told(await call("PUT", url, marks.map(bare)));
  announce(marks.length ? "The marks are kept." : "No mark is left.");
  refreshSoon();
}

async function add() {
  says.textContent = "";
  const fields = Object.fromEntries(new FormData(form));
  const one = fields.kind === "map_point";
  const mark = { kind: fields.kind, points: (one ? [fields.from] : [fields.from, fields.to]).map(numbers) };
  for (const name of one ? ["x_m", "y_m"] : ["length_m"])
    if (fields[name]?.trim() && fields.kind !== "horizon") mark[name] = Number(fields[name].replace(",", "."));
  try {
    await keep([...kept, mark]);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    says.textContent = error.problem.errors?.[0]?.reason ?? error.message;
    return; // what was typed stays
  }
  for (const name of ["from", "to", "length_m", "x_m", "y_m"]) form.elements[name].value = "";
  show();
  form.elements.from.focus();
}

function choose() {
  for (const place of form.querySelectorAll("[data-for]"))
    place.hidden = !place.dataset.for.split(" ").includes(form.elements.kind.value);
}

document.addEventListener("pointerdown", down);
document.addEventListener("pointermove", move);
document.addEventListener("pointerup", () => (begun = null));
document.addEventListener("camera-news", show);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(form.querySelector("button"), add);
});
form.addEventListener("input", show);
form.elements.kind.addEventListener("change", choose);
choose();
call("GET", url).then(told, console.warn);
