// The page of a camera: what happens is fetched and exchanged part by part; actions are calls.

import { announce, call, confirmed, guarded } from "./act.js";
import { ALERT_ACTIONS, done, listen, planMaintenance } from "./alert_actions.js";
import { myName, nameMe, signed } from "./dialogs.js";
import { debounced, subscribe } from "./events.js";
import { keepTimes } from "./times.js";
import { _ } from "./words.js";

const root = document.getElementById("camera");
const camera = root.dataset.camera;
const path = `/cameras/${encodeURIComponent(camera)}`;

// --- Parts -------------------------------------------------------------------------------------

const was = new WeakMap(); // what the service last said of each part: scripts change the page's own
for (const part of document.querySelectorAll("[data-part]")) was.set(part, part.innerHTML);

/** Exchange the parts of the page that have changed; what is open stays open, focus stays. */
async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" } });
  // Somebody has removed it; another may come under its id.
  root.hidden = answer.status === 404;
  document.getElementById("removed").hidden = !root.hidden;
  if (root.hidden) document.title = `${_("Removed")} · surefoot`;
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
}

function exchange(part, news) {
  const before = part.querySelector(".summary")?.dataset;
  const focused = part.contains(document.activeElement) ? keyOf(document.activeElement) : null;
  const open = [...part.querySelectorAll("details")].map((each) => each.open);
  const typed = [...part.querySelectorAll("input[id]")].map(({ id, value }) => [id, value]);
  part.replaceChildren(...news.childNodes);
  for (const [id, value] of typed) {
    const field = document.getElementById(id);
    if (field?.type === "text") field.value = value;
  }
  part.querySelectorAll("details").forEach((each, at) => (each.open = open[at] ?? false));
  if (focused) {
    const again = [...part.querySelectorAll("button, input, a, summary")].find((each) => keyOf(each) === focused);
    (again ?? document.getElementById("main")).focus({ preventScroll: true });
  }
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
    place.textContent = myName() || _("nobody yet");
  }
  const answered = document.querySelector("[data-who]");
  if (answered && myName() && answered.dataset.who === myName()) answered.textContent = _("You");
}

/** Do something in somebody's name, and show what came of it. */
const put = (words, method, url, body) => done(words, signed(method, url, body));

document.addEventListener("acted", () => refresh().catch(() => {}));

const ACTIONS = {
  ...ALERT_ACTIONS,
  accept: () => put(_("New aim kept."), "POST", `${path}/pose/accept`),
  "put-back": () => put(_("Put back."), "POST", `${path}/pose/put-back`),
  relearn: () => put(_("Being learned anew."), "POST", `${path}/reference/reset`),
  undo: () => put(_("Undone."), "POST", `${path}/pose/undo`),

  async confirm() {
    const yes = await confirmed({
      title: _("Does it look right?"),
      detail: _(
        "The proposed pose becomes the prior pose, with its uncertainty. Check that the horizon and " +
          "the grid match the scene; a still image behind them helps. From then on, moves are measured " +
          "relative to this pose.",
      ),
      yes: _("Confirm"),
    });
    if (yes && (await signed("POST", `${path}/pose/confirm`)) !== undefined) location.reload();
  },

  async "use-source"({ source }) {
    const yes = await confirmed({
      title: _("Let the tracks of {source} count?", { source }),
      detail: _(
        "The camera is judged by this source alone from now on. Its reference is learned anew, " +
          "of tracks that were seen while the camera was where it should be.",
      ),
      yes: _("Let it count"),
    });
    const url = `${path}/sources/${encodeURIComponent(source)}/use`;
    if (yes) await put(_("It counts from now on."), "POST", url);
  },

  async train() {
    await done(_("A training is queued."), call("POST", `${path}/trainings`, myName() ? { by: myName() } : {}));
  },

  async cancel({ training }) {
    const yes = await confirmed({
      title: _("Cancel the training?"),
      detail: _("What it has learned so far is lost. The model in use stays in use."),
      yes: _("Cancel the training"),
    });
    if (yes) await done(_("The training is cancelled."), call("DELETE", `/trainings/${training}`));
  },

  maintain: () => planMaintenance((body) => put(_("Maintenance planned."), "POST", `${path}/maintenance`, body)),

  async "end-window"({ window: id, state }) {
    const yes = await confirmed({
      title: state === "under way" ? _("End the maintenance now?") : _("Take the maintenance back?"),
      detail:
        state === "under way"
          ? _("The camera is judged again by people who come from now on.")
          : _("The camera will be judged then as ever."),
      yes: state === "under way" ? _("End it now") : _("Take it back"),
    });
    if (!yes || !(await nameMe())) return;
    const who = myName() ? `?by=${encodeURIComponent(myName())}` : "";
    await done(_("Done."), call("DELETE", `${path}/maintenance/${id}${who}`));
  },

  async "still-remove"() {
    await done(_("The still image is deleted."), call("DELETE", `${path}/snapshot`));
  },

  async name() {
    await nameMe({ again: true });
    showName();
  },
};

listen(root, ACTIONS);

root.addEventListener("change", (event) => {
  const file = event.target.dataset.action === "still" && event.target.files[0];
  if (file) guarded(event.target, () => sendStill(file));
});

root.addEventListener("input", ({ target }) => {
  if (target.dataset.action !== "compare") return;
  target.closest("figure").style.setProperty("--shown", `${target.value}%`);
});

async function sendStill(file) {
  await call("PUT", `${path}/snapshot`, file);
  announce(_("The still image is kept."));
  await refresh();
}

showName();
