// The page of a camera: what happens is fetched and exchanged part by part; actions are calls.

import { Refused, announce, call, confirmed, guarded } from "./act.js";
import { ask, myName, nameMe } from "./camera_dialogs.js";
import { debounced, subscribe } from "./events.js";
import { keepTimes } from "./times.js";

const root = document.getElementById("camera");
const camera = root.dataset.camera;
const path = `/cameras/${encodeURIComponent(camera)}`;

// --- Parts -------------------------------------------------------------------------------------

const was = new WeakMap(); // what the service last said of each part: scripts change the page's own
for (const part of document.querySelectorAll("[data-part]")) was.set(part, part.innerHTML);

/** Exchange the parts of the page that have changed; what is open stays open, focus stays. */
async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" } });
  if (answer.status === 404) return location.reload(); // somebody has removed it
  if (!answer.ok || answer.redirected) return;
  const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
  document.title = fresh.title;
  for (const part of document.querySelectorAll("[data-part]")) {
    const news = fresh.querySelector(`[data-part="${part.dataset.part}"]`);
    if (!news || news.innerHTML === was.get(part)) continue;
    was.set(part, news.innerHTML);
    exchange(part, news);
  }
  showName();
  document.dispatchEvent(new CustomEvent("camera-news"));
}

function exchange(part, news) {
  const before = part.querySelector(".summary")?.dataset;
  const focused = part.contains(document.activeElement) ? keyOf(document.activeElement) : null;
  const open = [...part.querySelectorAll("details")].map((each) => each.open);
  part.replaceChildren(...news.childNodes);
  part.querySelectorAll("details").forEach((each, at) => (each.open = open[at] ?? false));
  if (focused) [...part.querySelectorAll("button, input, a, summary")].find((each) => keyOf(each) === focused)?.focus();
  const after = part.querySelector(".summary")?.dataset;
  if (before && after && (before.state !== after.state || before.alerts !== after.alerts)) {
    announce(part.querySelector(".headline").textContent);
  }
}

const keyOf = (each) => [each.tagName, each.id, ...Object.values(each.dataset)].join(" ");

export const refreshSoon = debounced(() => refresh().catch(() => {}), 250);
subscribe(({ data }) => {
  if (data.camera_id === camera || data.camera_ids?.includes(camera)) refreshSoon();
});

keepTimes(document.querySelector('[data-part="summary"]'));

// --- Actions -----------------------------------------------------------------------------------

function showName() {
  for (const place of document.querySelectorAll("[data-by]")) {
    place.textContent = myName() || "nobody yet";
  }
}

const signed = (body = {}) => (myName() ? { ...body, by: myName() } : body);

/** The body of an act with the name of who does it, asked for once; null where it is called off. */
async function asMe(body = {}) {
  return (await nameMe()) ? signed(body) : null;
}

async function put(words, method, url, body) {
  const done = await call(method, url, body);
  announce(words);
  await refresh();
  return done;
}

const ACTS = {
  async acknowledge({ alert }) {
    const body = await asMe();
    if (body) await put("Acknowledged.", "POST", `/alerts/${alert}/acknowledge`, body);
  },

  async silence({ alert }) {
    const said = await ask("silence-dialog");
    if (!said) return;
    const body = await asMe({ until: silentUntil(said), ...(said.reason && { reason: said.reason }) });
    if (body) await put("Silenced.", "POST", `/alerts/${alert}/silence`, body);
  },

  async unsilence({ alert }) {
    const body = await asMe({ until: null });
    if (body) await put("The silence has ended.", "POST", `/alerts/${alert}/silence`, body);
  },

  async resolve({ alert, identifiable }) {
    const said = await ask("resolve-dialog", { needsPose: identifiable === "yes" });
    if (!said) return;
    if (said.outcome === "accepted") return ACTS.accept({ note: said.note });
    const body = await asMe({ outcome: said.outcome, ...(said.note && { note: said.note }) });
    if (body) await put("Resolved.", "POST", `/alerts/${alert}/resolve`, body);
  },

  async accept({ note }) {
    const yes = await confirmed({
      title: "Accept the new pose?",
      detail:
        "The served pose becomes the prior pose, and open alerts about it are closed. " +
        "A new reference is learned from people who come from now on. This cannot be undone.",
      yes: "Accept the new pose",
    });
    const body = yes && (await asMe(note ? { note } : {}));
    if (body) await put("Accepted: a new reference begins.", "POST", `${path}/pose/accept`, body);
  },

  async agree() {
    const yes = await confirmed({
      title: "Does it look right?",
      detail:
        "The pose that people told becomes the prior pose, as sure as it is. Look whether the " +
        "horizon and the grid lie on the ground; a still image behind them helps. Moves are told " +
        "against it from then on.",
      yes: "Agree to it",
    });
    const body = yes && (await asMe());
    if (!body) return;
    await call("POST", `${path}/pose/agree`, body);
    location.reload();
  },

  async "put-back"() {
    const yes = await confirmed({
      title: "Was the camera put back?",
      detail:
        "It is taken to stand at its prior pose again, and open alerts about it are closed. " +
        "Whoever comes from now on tells how it stands, against what was learned there.",
      yes: "It was put back",
    });
    const body = yes && (await asMe());
    if (body) await put("Noted: the next people will tell.", "POST", `${path}/pose/put-back`, body);
  },

  async relearn() {
    const yes = await confirmed({
      title: "Learn it anew?",
      detail:
        "It is taken to stand at its prior pose, exactly, and open alerts about it are closed. " +
        "What was learned so far is dropped and learned anew from now on. This cannot be undone.",
      yes: "Learn it anew",
    });
    const body = yes && (await asMe());
    if (body) await put("Noted: a new reference begins.", "POST", `${path}/reference/reset`, body);
  },

  async "use-source"({ source }) {
    const yes = await confirmed({
      title: `Let the tracks of ${source} count?`,
      detail:
        "The camera is judged by this source alone from now on. Its reference is learned anew, " +
        "of tracks that were seen while the camera was where it should be.",
      yes: "Let it count",
    });
    const body = yes && (await asMe());
    const url = `${path}/sources/${encodeURIComponent(source)}/use`;
    if (body) await put("It counts from now on.", "POST", url, body);
  },

  async train() {
    await put("A training is queued.", "POST", `${path}/trainings`, signed());
  },

  async cancel({ training }) {
    const yes = await confirmed({
      title: "Cancel the training?",
      detail: "What it has learned so far is lost. The model in use stays in use.",
      yes: "Cancel the training",
    });
    if (yes) await put("The training is cancelled.", "DELETE", `/trainings/${training}`);
  },

  async maintain() {
    const said = await ask("maintain-dialog");
    if (!said) return;
    const times = { to: new Date(said.to).toISOString() };
    if (said.from) times.from = new Date(said.from).toISOString();
    const body = await asMe({ ...times, ...(said.reason && { reason: said.reason }) });
    if (body) await put("Maintenance is planned.", "POST", `${path}/maintenance`, body);
  },

  async "end-window"({ window: id, state }) {
    const yes = await confirmed({
      title: state === "under way" ? "End the maintenance now?" : "Take the maintenance back?",
      detail:
        state === "under way"
          ? "The camera is judged again by people who come from now on."
          : "The camera will be judged then as ever.",
      yes: state === "under way" ? "End it now" : "Take it back",
    });
    const body = yes && (await asMe());
    const who = body?.by ? `?by=${encodeURIComponent(body.by)}` : "";
    if (body) await put("Done.", "DELETE", `${path}/maintenance/${id}${who}`);
  },

  async "still-remove"() {
    await put("The still image is deleted.", "DELETE", `${path}/snapshot`);
  },

  async name() {
    await nameMe({ again: true });
    showName();
  },
};

function silentUntil({ how, until }) {
  if (how === "date") return new Date(until).toISOString();
  if (how === "tomorrow") return root.dataset.tomorrow;
  return new Date(Date.now() + Number(how) * 3_600_000).toISOString();
}

root.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-act]");
  if (button) guarded(button, () => ACTS[button.dataset.act]({ ...button.dataset }));
});

root.addEventListener("change", (event) => {
  const file = event.target.dataset.act === "still" && event.target.files[0];
  if (file) guarded(event.target, () => sendStill(file));
});

async function sendStill(file) {
  const answer = await fetch(`${path}/snapshot`, {
    method: "PUT", body: file, headers: { "Content-Type": file.type },
  });
  if (!answer.ok) throw new Refused(await answer.json());
  announce("The still image is kept.");
  await refresh();
}

showName();
