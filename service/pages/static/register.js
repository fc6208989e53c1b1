// The form's preview, drawn by the server while somebody types; nothing is stored before the end.

import { announce, call, guarded, showProblem } from "./act.js";
import { debounced } from "./events.js";
import { _, _n } from "./words.js";

const WAIT_MS = 250;
const DRAFT = "surefoot-register";
const SHAPES = { critical: "i-drifting", warning: "i-warning", good: "i-ok", info: "i-info" };
const form = document.getElementById("register");
const says = document.getElementById("says");

let tracks = [];
let asked = 0;
// What the last try to register was refused for; until a field is changed, that stands beside it.
let refused = {};

const fields = () => Object.fromEntries(new FormData(form));

/** Show what is wrong beside the fields. */
function showErrors(errors, only = () => true) {
  for (const place of form.querySelectorAll("[data-field]")) {
    const name = place.dataset.field;
    const reason = refused[name] ?? (only(name) ? (errors[name] ?? "") : "");
    document.getElementById(`${name}-error`).textContent = reason;
    const input = document.getElementById(name);
    if (reason) input.setAttribute("aria-invalid", "true");
    else input.removeAttribute("aria-invalid");
  }
}

function say({ kind, text, field, value }) {
  const banner = document.createElement("div");
  banner.className = `banner ${kind}`;
  banner.innerHTML = `<svg class="icon" aria-hidden="true"><use href="#${SHAPES[kind]}"/></svg><div><p></p></div>`;
  banner.querySelector("p").textContent = text;
  if (value) {
    const mend = document.createElement("button");
    mend.type = "button";
    mend.textContent = _("Make it {value}", { value });
    mend.addEventListener("click", () => {
      const input = document.getElementById(field);
      input.value = value;
      input.focus();
      look();
    });
    banner.lastElementChild.append(mend);
  }
  return banner;
}

/** Ask how it looks. An answer that comes after a later one is not shown. */
async function look() {
  const number = ++asked;
  let answer;
  try {
    answer = await call("POST", "/ui/preview", { fields: fields(), tracks });
  } catch (error) {
    if (number === asked) says.replaceChildren(say({ kind: "critical", text: error.message }));
    return;
  }
  if (number !== asked) return;
  // While somebody types, what is half typed is not wrong yet.
  showErrors(answer.errors, (name) => document.activeElement?.id !== name);
  const words = answer.says.map((said) => said.kind + said.text).join();
  if (says.dataset.words !== words) {
    says.dataset.words = words;
    says.replaceChildren(...answer.says.map(say));
  }
  const picture = document.getElementById("picture");
  picture.classList.toggle("stale", !answer.picture);
  if (answer.picture) {
    picture.innerHTML = answer.picture;
    const label = picture.firstElementChild.getAttribute("aria-label").split("; ")[1];
    document.getElementById("squares").textContent = `${_("ground")}, ${label}`;
    document.getElementById("caption").hidden = !picture.querySelector(".grid");
  }
  document.getElementById("ground").innerHTML = answer.ground;
  document.getElementById("ground-figure").hidden = !answer.ground;
}

const lookSoon = debounced(look, WAIT_MS);

/** Of what is told in one of several ways, show the fields of the chosen one. */
function showForm() {
  const chosen = fields();
  for (const place of form.querySelectorAll("[data-of]"))
    place.hidden = !place.dataset.of.split(" ").includes(chosen[place.dataset.choice]);
}

function fill(values) {
  for (const [name, value] of Object.entries(values)) {
    const input = form.elements[name];
    if (input) input.value = value;
  }
  showForm();
}

/** Send a file, and say beside its field what became of it. */
async function send(input, url, type, use) {
  const help = document.getElementById(`${input.id}-help`);
  const wrong = document.getElementById(`${input.id}-error`);
  const [file] = input.files;
  wrong.textContent = "";
  input.removeAttribute("aria-invalid");
  if (!file) return;
  try {
    const answer = await call("POST", url, file, { "Content-Type": type });
    use(answer);
    help.textContent = answer.text;
    await look();
  } catch (error) {
    const reason = error.problem?.errors?.[0]?.reason;
    wrong.textContent = reason ?? error.message;
    input.setAttribute("aria-invalid", "true");
  }
}

function sendTracks() {
  const { width, height, frame_rate_hz } = fields();
  const query = new URLSearchParams({ width: width || 1920, height: height || 1080 });
  const rate = Number(frame_rate_hz.replace(",", "."));
  if (rate > 0 && rate <= 1000) query.set("frame_rate_hz", rate);
  return send(document.getElementById("tracks"), `/ui/tracks?${query}`, "text/csv", (answer) => {
    tracks = answer.tracks;
  });
}

async function register() {
  try {
    const camera = await call("POST", "/ui/register", fields());
    sessionStorage.removeItem(DRAFT);
    location.assign(`/ui/cameras/${encodeURIComponent(camera.id)}`);
  } catch (error) {
    const { errors = [], detail = "", code } = error.problem ?? {};
    refused = Object.fromEntries(errors.map(({ pointer, reason }) => [pointer.slice(1), reason]));
    if (code === "conflict") refused.id = detail.replace(/^id: /, "");
    showErrors({});
    const first = form.querySelector("[data-field] [aria-invalid]");
    if (!first) return showProblem(error);
    first.closest("details")?.setAttribute("open", "");
    first.focus();
    const count = Object.keys(refused).length;
    announce(_n("{n} field needs another look.", "{n} fields need another look.", count));
  }
}

form.addEventListener("input", (event) => {
  if (event.target.type === "file") return;
  delete refused[event.target.name];
  if (event.target.type === "radio") showForm();
  sessionStorage.setItem(DRAFT, JSON.stringify(fields()));
  lookSoon();
});
form.addEventListener("change", (event) => event.target.type !== "file" && look());
form.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(document.getElementById("submit"), register);
});
document.getElementById("tracks").addEventListener("change", sendTracks);
const file = document.getElementById("file");
file.addEventListener("change", () => {
  const query = new URLSearchParams({ camera: fields().id || fields().name });
  return send(file, `/ui/calibration?${query}`, "application/octet-stream", (answer) =>
    fill(answer.fields),
  );
});

// A file that was mended and is chosen again is news, too.
for (const input of form.querySelectorAll('input[type="file"]')) {
  input.addEventListener("click", () => (input.value = ""));
}

// What was typed outlives a reload, in this tab alone.
fill(JSON.parse(sessionStorage.getItem(DRAFT) ?? "{}"));
showForm();
look();
