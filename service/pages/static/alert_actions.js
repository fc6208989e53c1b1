// What can be done with an alert on any page: answered, acknowledged, silenced.

import { announce, guarded } from "./act.js";
import { ask, signed } from "./dialogs.js";
import { _ } from "./words.js";
import { instant, tomorrow } from "./zoned.js";

const path = (alert, act) => `/alerts/${encodeURIComponent(alert)}/${act}`;

/** Do something and say so; whoever listens for "acted" shows what came of it. */
export async function done(words, what) {
  const answer = await what;
  if (answer === undefined) return undefined;
  document.querySelector(".undo.toast")?.replaceChildren(); // it would be taken for one of this
  announce(words);
  document.dispatchEvent(new CustomEvent("acted"));
  return answer ?? null;
}

export const ALERT_ACTIONS = {
  answer({ alert, outcome, done: word }) {
    const note = document.getElementById(`note-${alert}`)?.value.trim();
    const body = { outcome, ...(note && { note }) };
    return done(`${word}.`, signed("POST", path(alert, "resolve"), body));
  },

  acknowledge({ alert }) {
    return done(_("Acknowledged."), signed("POST", path(alert, "acknowledge")));
  },

  "give-back"({ alert }) {
    return done(_("Given back."), signed("POST", path(alert, "acknowledge"), { acknowledged: false }));
  },

  silence({ alert }) {
    return ask("silence-dialog", {
      send: (said) => done(_("Silenced."), signed("POST", path(alert, "silence"), silenceOf(said))),
    });
  },

  unsilence({ alert }) {
    return done(_("The silence has ended."), signed("POST", path(alert, "silence"), { until: null }));
  },
};

/** The body of a silence, of what was said in its dialog. */
export function silenceOf({ how, until, reason }) {
  const ends =
    how === "date" ? instant(until)
    : how === "tomorrow" ? tomorrow()
    : new Date(Date.now() + Number(how) * 3_600_000).toISOString();
  return { until: ends, ...(reason && { reason }) };
}

/** Ask when somebody is at the camera, or cameras, and send it, which says what was done. */
export function planMaintenance(send) {
  return ask("maintain-dialog", {
    send: ({ from, to, reason }) => {
      const times = { to: instant(to), ...(from && { from: instant(from) }) };
      return send({ ...times, ...(reason && { reason }) });
    },
  });
}

const DOUBLE_MS = 800;
const NEAR_PX = 40;

/** Do by a click on a button with data-action what it names, and say what is refused. */
export function listen(root, acts) {
  let last = { at: -DOUBLE_MS };
  root.addEventListener("renewed", () => (last = { ...last, at: performance.now() }));
  root.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-action]");
    if (!button || !acts[button.dataset.action]) return;
    // A row that was answered goes, and the next one's button lies under the pointer: a second click
    // at one place is no answer to another alert.
    const { clientX: x, clientY: y, detail } = event;
    const again = performance.now() - last.at < DOUBLE_MS && Math.hypot(x - last.x, y - last.y) < NEAR_PX;
    if (detail && again && button.dataset.alert !== last.alert) return;
    last = { at: performance.now(), x, y, alert: button.dataset.alert };
    guarded(button, () => acts[button.dataset.action]({ ...button.dataset }, button));
  });
}
