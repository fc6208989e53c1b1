// One act with many alerts or cameras: POST /acts has an answer for each.

import { Refused, call } from "./act.js";
import { done, planMaintenance, silenceOf } from "./alert_acts.js";
import { ask, signed, wordsIn } from "./dialogs.js";

const WORDS = {
  acknowledge: "Acknowledged.",
  silence: "Silenced.",
  maintenance: "Maintenance is planned.",
  tag: "Tagged.",
  undo: "Taken back.",
};
const AT_ONCE = 500;
const OF_ALERTS = ["acknowledge", "silence"];

/** Do an act with some ids; says how many were refused, and why the first was. */
export async function actOn(act, ids, more = {}) {
  const items = [];
  for (let at = 0; at < ids.length; at += AT_ONCE) {
    const answer = await signed("POST", "/acts", { ids: ids.slice(at, at + AT_ONCE), act, ...more });
    if (answer === undefined) return undefined;
    items.push(...answer.items);
  }
  const refused = items.filter(({ problem }) => problem);
  const said = refused.length ? ` Not done with ${refused.length} of ${ids.length}: ${refused[0].problem.detail}.` : "";
  return done(`${WORDS[act] ?? "Noted."}${said}`, Promise.resolve(items));
}

/** Do an act with cameras, or with the alerts of theirs that fire; asks what it has to know. */
export async function withMany(act, cameras, after) {
  const ids = OF_ALERTS.includes(act) ? await alertsOf(cameras) : cameras;
  const send = async (more) => {
    const items = ids.length ? await actOn(act, ids, more) : await done("No alert of theirs fires.", Promise.resolve([]));
    if (items !== undefined) after();
    return items;
  };
  if (act === "silence") return ask("silence-dialog", { send: (said) => send(silenceOf(said)) });
  if (act === "maintenance") return planMaintenance(send);
  if (act === "tag") return ask("tag-dialog", { send: (said) => send(tagsOf(said)) });
  return send();
}

function tagsOf({ add, remove }) {
  const more = { add: wordsIn(add), remove: wordsIn(remove) };
  if (more.add.length || more.remove.length) return more;
  throw new Refused({ errors: [{ pointer: "/add", reason: "a word is needed, here or below" }] });
}

async function alertsOf(cameras) {
  const { items } = await call("GET", "/alerts?state=firing&limit=1000");
  const wanted = new Set(cameras);
  return items.filter(({ camera_id }) => wanted.has(camera_id)).map(({ id }) => id);
}
