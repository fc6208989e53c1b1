// The panel of a camera that learns: what comes for it, live; a token, commands, a file to post.

import { announce, call, guarded, Refused } from "./act.js";
import { refreshSoon } from "./camera.js";
import { _ } from "./words.js";

const panel = document.getElementById("connect");
const live = document.getElementById("posts");
const says = document.getElementById("drop-says");
const EVERY_MS = 3000;
const TYPES = {
  json: "application/json",
  ndjson: "application/x-ndjson",
  jsonl: "application/x-ndjson",
  csv: "text/csv",
  tsv: "text/csv",
  txt: "text/csv",
};
/** What is shown for each reason to skip tracks. */
const SKIPPED = {
  not_a_person: (n) => _("{n} skipped: not a person", { n }),
  ignored_by_confidence: (n) => _("{n} skipped: confidence 0", { n }),
  no_track_id: (n) => _("{n} skipped: no track id", { n }),
};

let token = null;
let timer = null;

// --- Live --------------------------------------------------------------------------------------

/** Exchange what is said of the posts; once the reference is there, the panel has done its work. */
async function look() {
  const camera = document.getElementById("camera").dataset.camera;
  const answer = await fetch(`/ui/cameras/${encodeURIComponent(camera)}/posts`);
  if (!answer.ok || answer.redirected) return;
  const holder = document.createElement("template");
  holder.innerHTML = await answer.text();
  const open = live.querySelector("details")?.open;
  live.replaceChildren(holder.content);
  live.removeAttribute("aria-busy");
  if (open) live.querySelector("details")?.setAttribute("open", "");
  const { state, ready, people } = live.querySelector(".posts").dataset;
  const shown = document.querySelector(".summary").dataset;
  if (shown.state !== state || shown.people !== people) refreshSoon();
  if (ready === "yes") finish();
}

function finish() {
  clearInterval(timer);
  announce(_("The reference is learned."));
  refreshSoon();
  panel.remove();
}

const lookAgain = () => document.hidden || look().catch(console.warn);

// --- Commands ----------------------------------------------------------------------------------

/** Put the tracker's name into the commands, as it may stand in them. */
function showSource() {
  const name = document.getElementById("tracker").value.trim() || "tracker";
  for (const place of panel.querySelectorAll("[data-source]")) {
    const text = place.closest("#csv") ? encodeURIComponent(name) : JSON.stringify(name).slice(1, -1);
    place.textContent = text.replaceAll("'", place.closest("#csv") ? "%27" : "\\u0027");
  }
}

async function makeToken() {
  const camera = document.getElementById("camera").dataset.camera;
  const body = { name: _("tracks of {camera}", { camera }), scopes: ["ingest"], cameras: [camera] };
  token = (await call("POST", "/tokens", body)).token;
  for (const place of panel.querySelectorAll("[data-token]")) place.textContent = token;
  document.getElementById("made-token").hidden = false;
  announce(_("The token is made, and stands in the commands."));
}

async function copy(name) {
  const pre = document.getElementById(name);
  try {
    await navigator.clipboard.writeText(pre.textContent);
    announce(_("Copied."));
  } catch {
    // Plain HTTP has no clipboard: what is to be copied is chosen, at least.
    getSelection().selectAllChildren(pre);
    announce(_("Chosen: copy it with the keyboard."));
  }
}

// --- A file ------------------------------------------------------------------------------------

function addressOf(type) {
  const query = new URLSearchParams();
  if (type !== TYPES.json) query.set("source", document.getElementById("tracker").value.trim() || "tracker");
  if (type === TYPES.csv) {
    const began = document.getElementById("began").value;
    const rate = document.getElementById("rate").value.trim().replace(",", ".");
    if (began) query.set("started_at", new Date(began).toISOString());
    if (rate) query.set("frame_rate_hz", rate);
    for (const name of ["layout", "classes"]) {
      const typed = document.getElementById(name).value.trim();
      if (typed) query.set(name, typed);
    }
  }
  return panel.dataset.tracks + (query.size ? `?${query}` : "");
}

async function post(file) {
  const type = TYPES[file.name.split(".").at(-1).toLowerCase()];
  if (!type) throw refused(_("{name}: a file that ends in .json, .ndjson, .csv, .tsv or .txt is needed.", { name: file.name }));
  if (panel.dataset.posts === "no" && !token) {
    throw refused(_("Who is logged in here may not post tracks: make a token first, or use a command."));
  }
  says.textContent = _("Posting {name}…", { name: file.name });
  const headers = { "Content-Type": type, ...(token && { Authorization: `Bearer ${token}` }) };
  const answer = await call("POST", addressOf(type), file, headers);
  const { accepted, duplicates, rejected, skipped = {} } = answer;
  const counts = { taken: accepted, known: duplicates, refused: rejected.length };
  const parts = [_("{taken} taken, {known} known before, {refused} refused", counts)];
  for (const [reason, n] of Object.entries(skipped)) parts.push(SKIPPED[reason]?.(n) ?? `${n} ${reason}`);
  says.textContent = `${file.name}: ${parts.join(", ")}.`;
}

const refused = (detail) => new Refused({ title: _("Not posted"), detail });

async function send(file) {
  if (!file) return;
  says.classList.remove("wrong");
  try {
    await post(file);
  } catch (error) {
    says.classList.add("wrong");
    says.textContent = error.reason ?? error.message;
  }
  await look();
}

if (panel) {
  const input = document.getElementById("tracks-file");
  const drop = document.getElementById("drop");
  input.addEventListener("change", () => {
    const [file] = input.files;
    input.value = ""; // the same file again is news, too
    guarded(input, () => send(file));
  });
  drop.addEventListener("submit", (event) => event.preventDefault());
  for (const type of ["dragenter", "dragover", "dragleave", "drop"]) {
    drop.addEventListener(type, (event) => {
      event.preventDefault();
      drop.classList.toggle("over", type === "dragenter" || type === "dragover");
      if (type === "drop") guarded(null, () => send(event.dataTransfer.files[0]));
    });
  }
  document.getElementById("tracker").addEventListener("input", showSource);
  const make = document.getElementById("make-token");
  make?.addEventListener("click", () => guarded(make, makeToken));
  panel.addEventListener("click", ({ target }) => target.dataset.copy && copy(target.dataset.copy));
  document.addEventListener("visibilitychange", lookAgain);
  timer = setInterval(lookAgain, EVERY_MS);
  lookAgain();
}
