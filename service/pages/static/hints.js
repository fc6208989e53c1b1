// Marks in the picture of a camera that nobody has calibrated: drawn or typed, kept, taken back.

import { announce, call, guarded, Refused } from "./act.js";
import { refreshSoon } from "./camera.js";
import { drags, drawMarks } from "./pointing.js";
import { _, language } from "./words.js";

const form = document.getElementById("hint");
const list = document.getElementById("hint-list");
const says = document.getElementById("hint-says");
const camera = document.getElementById("camera").dataset.camera;
const url = `/cameras/${encodeURIComponent(camera)}/hints`;
const NAMES = { vertical: _("Vertical"), length: _("Length"), horizon: _("Horizon"), map_point: _("Map point") };
const LIES = 3; // standard deviations, from which on a mark is doubted
const over = document.getElementById("over");
const place = document.getElementById("over-marks");

let kept = [];

// --- Drawing -----------------------------------------------------------------------------------

const typed = ([u, v]) => `${u} ${v}`;
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);
const metres = (text) => Number(text.replace(",", "."));
const isOne = () => form.elements.kind.value === "map_point";

function press(at) {
  if (over.closest(".zoning")) return false;
  form.elements.from.value = typed(at);
  form.elements.to.value = "";
  show();
}

function drag(at) {
  form.elements[isOne() ? "from" : "to"].value = typed(at);
  show();
}

/** Draw the marks, and the one that is being made; those of a map on its plan, too. */
function show() {
  const { from, to, x_m, y_m } = form.elements;
  const made = [from, to].map(({ value }) => numbers(value)).filter((at) => at.length === 2);
  drawMarks(place, [...kept.map(({ points }, n) => ({ points, label: label(n) })), { points: made, made: true }]);
  const spot = x_m.value && y_m.value ? [x_m, y_m].map(({ value }) => metres(value)) : null;
  document.dispatchEvent(new CustomEvent("marks", { detail: { kept, label, spot } }));
}

const label = (n) => (kept[n].kind === "map_point" ? `${n + 1}` : "");

// --- Keeping -----------------------------------------------------------------------------------

function row(mark, number) {
  const item = document.createElement("li");
  const words = document.createElement("span");
  const size = mark.length_m ? ` ${_("of {m} m", { m: mark.length_m.toLocaleString(language) })}` : "";
  const lies = mark.residual_sd > LIES ? `: ${_("it does not fit the others")}` : "";
  words.textContent = `${NAMES[mark.kind]} ${label(number)}`.trim() + size + lies;
  const button = document.createElement("button");
  button.type = "button";
  button.className = "slim";
  button.textContent = _("Take back");
  button.setAttribute("aria-label", `${_("Take back")}: ${words.textContent}`);
  button.addEventListener("click", () => guarded(button, () => keep(kept.filter((mark, at) => at !== number))));
  item.className = "row";
  item.append(words, button);
  return item;
}

function told(answer) {
  kept = answer.items;
  list.replaceChildren(...kept.map(row));
  show();
}

const bare = ({ residual_sd, ...mark }) => Object.fromEntries(Object.entries(mark).filter(([, value]) => value !== null));

async function keep(marks) {
  told(await call("PUT", url, marks.map(bare)));
  announce(marks.length ? _("The marks are kept.") : _("No mark is left."));
  refreshSoon();
}

async function add() {
  says.textContent = "";
  const fields = Object.fromEntries(new FormData(form));
  const one = isOne();
  const mark = { kind: fields.kind, points: (one ? [fields.from] : [fields.from, fields.to]).map(numbers) };
  for (const name of one ? ["x_m", "y_m", "sd_m"] : ["length_m"])
    if (fields[name]?.trim() && fields.kind !== "horizon") mark[name] = metres(fields[name]);
  try {
    await keep([...kept, mark]);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    says.textContent = error.reason;
    return; // what was typed stays
  }
  for (const name of ["from", "to", "length_m", "x_m", "y_m", "sd_m"]) form.elements[name].value = "";
  show();
  form.elements.from.focus();
}

function choose() {
  for (const part of document.querySelectorAll("#hints [data-for]"))
    part.hidden = !part.dataset.for.split(" ").includes(form.elements.kind.value);
}

drags(over, press, drag);
document.addEventListener("plan-place", ({ detail }) => {
  for (const [name, value] of Object.entries(detail)) form.elements[name].value = value;
  show();
});
form.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(form.querySelector("button"), add);
});
form.addEventListener("input", ({ target }) => {
  if (["x_m", "y_m"].includes(target.name)) form.elements.sd_m.value = ""; // it is the plan's no more
  show();
});
form.elements.kind.addEventListener("change", choose);
choose();
call("GET", url).then(told, console.warn);
