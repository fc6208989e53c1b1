// One act with one alert or many, or with cameras: POST /actions has an answer for each, and says until
// when it can be undone. What is offered for what is chosen is the service's rule (pages/bulk.py).

import { Refused, announce, call, guarded, plainly } from "./act.js";
import { planMaintenance, silenceOf } from "./alert_actions.js";
import { ask, signed, wordsIn } from "./dialogs.js";
import { _, _n } from "./words.js";

const AT_ONCE = 500;
const FEW = 3;
const OF_ALERTS = ["resolve", "acknowledge", "silence"];
const RULE = JSON.parse(document.getElementById("rule")?.textContent ?? "{}");

// As of an alert that has ended (service/alerts/alerts.py).
const ANSWERED = { status: 409, detail: "state: only a firing alert takes this" };

// --- What is offered -----------------------------------------------------------------------------

/**
 * Offer what all of some items take, each of some `kinds`; says in words why it is no more. `waiting`
 * are an item's alerts that nobody has taken up: nobody is asked to acknowledge one a second time.
 * `fresh` items may have an answer that can be undone.
 */
export function offer(bulk, items, noun) {
  bulk.hidden = !items.length;
  document.getElementById("chosen").textContent = counted(items.length, noun);
  let lost = false;
  for (const button of bulk.querySelectorAll("[data-takes]")) {
    const able = items.filter(({ kinds }) => takes(kinds, button.dataset.takes)).length;
    const seen = button.dataset.takes === "acknowledge" && items.every(({ waiting }) => !Number(waiting));
    button.hidden = able < items.length || seen;
    lost ||= able > 0 && able < items.length;
  }
  const undo = bulk.querySelector('[data-bulk="undo"]');
  if (undo) undo.hidden = !items.some(({ fresh }) => fresh);
  const answers = bulk.querySelector('[data-bulk="resolve"]:not([hidden])');
  document.getElementById("mixed").textContent = lost || !answers ? mixture(items, lost) : "";
}

const takes = (kinds, action) => kinds.split(" ").some((kind) => RULE.kinds[kind].takes.includes(action));

/**
 * "Not every answer fits all: 2 of 5 are clock faults (Gate 1, Gate 2)." All but the most of a kind are told,
 * by their names where they are few; where none can be answered, all: "3 of 3 are answered with their tracker."
 */
function mixture(items, lost) {
  const names = new Map();
  for (const { kinds, name } of items) {
    if (!names.has(kinds)) names.set(kinds, []);
    names.get(kinds).push(name);
  }
  const fewer = [...names].sort(([, a], [, b]) => b.length - a.length).slice(lost ? 1 : 0);
  const parts = fewer.map(([kinds, own], at) => {
    const words = kinds.split(" ").map((kind) => RULE.kinds[kind].words[own.length === 1 ? 0 : 1]);
    const said = { n: own.length, all: items.length, are: words.join(_(" and ")) };
    const which = lost && own.length <= FEW ? ` (${own.join(", ")})` : "";
    return (at ? _("{n} {are}", said) : _("{n} of {all} {are}", said)) + which;
  });
  if (!lost) return items.length ? `${parts.join(", ")}.` : "";
  return _("Not every answer fits all: {some}.", { some: parts.join(", ") });
}

const counted = (n, noun) =>
  noun === "camera" ? _n("{n} camera", "{n} cameras", n) : _n("{n} alert", "{n} alerts", n);

// --- What is done --------------------------------------------------------------------------------

/** Do an act with all that are chosen: items with a `camera`, an `alert` or both, and a `name`. */
export async function withMany({ bulk: action, takes: wanted }, chosen, after) {
  const items = action === "acknowledge" ? chosen.filter(({ waiting }) => Number(waiting)) : chosen;
  const outcome = action === "resolve" ? { outcome: wanted } : {};
  const send = async (more) => {
    const targets = OF_ALERTS.includes(action) ? await alertsOf(items, wanted) : items.map((item) => [item.camera, item]);
    const done = await actOn(action, targets, items, { ...outcome, ...more });
    if (done !== undefined) after();
    return done;
  };
  if (action === "silence") return ask("silence-dialog", { send: (said) => send(silenceOf(said)) });
  if (action === "maintenance") return planMaintenance(send);
  if (action === "tag") return ask("tag-dialog", { send: (said) => send(tagsOf(said)) });
  return send();
}

/** Answer one alert; what is refused is thrown. */
export function answer({ alert, outcome, name }) {
  const item = { alert, name };
  return actOn("resolve", [[alert, item]], [item], { outcome });
}

/** Do an act with ids, each of an item, and say how many items it was done with. */
async function actOn(action, targets, items, more = {}) {
  const ids = [...new Set(targets.map(([id]) => id))];
  const problems = new Map();
  let undo = null;
  for (let at = 0; at < ids.length; at += AT_ONCE) {
    const told = await signed("POST", "/actions", { ids: ids.slice(at, at + AT_ONCE), action, ...more });
    if (told === undefined) return undefined;
    for (const { id, problem } of told.items) problems.set(id, problem);
    if (action === "acknowledge" && more.acknowledged !== false) undo = givenBack(told.items, undo);
    if (told.undo) undo = { ids: [...(undo?.ids ?? []), ...told.undo.ids], until: undo?.until ?? told.undo.until };
  }
  const refused = new Map(items.map((item) => [item, ANSWERED])); // unless something of it was still open
  for (const [, item] of targets) refused.delete(item);
  for (const [id, item] of targets) if (problems.get(id)) refused.set(item, problems.get(id));
  if (items.length === 1 && refused.size) throw new Refused(refused.get(items[0]));
  sayDone(RULE.done[more.acknowledged === false ? "undo" : (more.outcome ?? action)], items, refused, undo);
  document.dispatchEvent(new CustomEvent("acted"));
  return items;
}

/** What takes an acknowledgement back: by alerts, as long as other answers can be undone. */
const givenBack = (items, before) => ({
  ids: [...(before?.ids ?? []), ...items.filter(({ problem }) => !problem).map(({ id }) => id)],
  until: before?.until ?? new Date(Date.now() + UNDO_MS).toISOString(),
  by: ["acknowledge", { acknowledged: false }],
});

/** "Put back: 4 of 6 cameras; 2 were answered meanwhile." */
function sayDone(word, items, refused, undo) {
  const cameras = new Set(items.map(({ camera }) => camera).filter(Boolean));
  const all = (items.length === 1 && items[0].name) || counted(items.length, cameras.size === items.length ? "camera" : "alert");
  const some = refused.size ? _("{n} of {all}", { n: items.length - refused.size, all }) : all;
  const reasons = new Map();
  for (const problem of refused.values()) {
    const why = problem.detail.startsWith(ANSWERED.detail) ? "" : plainly(problem.detail);
    reasons.set(why, (reasons.get(why) ?? 0) + 1);
  }
  const others = [...reasons].map(([why, count]) =>
    why
      ? _("{n} not: {why}", { n: count, why: why.replace(/\.$/, "") })
      : _n("{n} was answered meanwhile", "{n} were answered meanwhile", count),
  );
  offerUndo(`${word}: ${[some, ...others].join("; ")}.`, undo);
}

// --- And undone ----------------------------------------------------------------------------------

const QUIET_MS = 10_000;
const UNDO_MS = 15 * 60_000; // as of answers (cameras/undo.py)
const undone = new Map();
let over = null;

/** True of a camera whose answer was just undone here: that its alert is open again is no news. */
export const undoneHere = ({ camera_id: camera }) => undone.get(camera) > Date.now();

/**
 * Say what was done, and offer to undo it as long as that is taken; else say it for a while. What was
 * offered before goes: its Undo would be taken for one of what was done last.
 */
function offerUndo(words, undo) {
  const place = document.getElementById("undo");
  const close = () => place.replaceChildren();
  clearTimeout(over);
  close();
  if (!undo?.ids.length) {
    announce(words);
    return;
  }
  announce("");
  const said = document.createElement("span");
  said.textContent = words;
  const [action, more] = undo.by ?? ["undo", {}];
  const items = undo.ids.map((id) => (undo.by ? { alert: id } : { camera: id }));
  const back = async () => {
    for (const id of undo.ids) undone.set(id, Date.now() + QUIET_MS); // events may come before the answer
    await actOn(action, items.map((item, at) => [undo.ids[at], item]), items, more);
  };
  place.replaceChildren(said, buttonOf(_("Undo"), "", back), buttonOf("×", _("Close"), close));
  over = setTimeout(close, Date.parse(undo.until) - Date.now());
}

function buttonOf(words, label, what) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "slim";
  button.textContent = words;
  if (label) button.setAttribute("aria-label", label);
  button.addEventListener("click", () => guarded(button, what));
  return button;
}

function tagsOf({ add, remove }) {
  const more = { add: wordsIn(add), remove: wordsIn(remove) };
  if (more.add.length || more.remove.length) return more;
  throw new Refused({ errors: [{ pointer: "/add", reason: _("a word is needed, here or below") }] });
}

/** The open alerts that take an action, each with the item that it is, or whose camera it is about. */
async function alertsOf(items, wanted) {
  if (items[0].alert) return items.map((item) => [item.alert, item]);
  const of = new Map(items.map((item) => [item.camera, item]));
  const found = [];
  for (let cursor = ""; cursor !== null; ) {
    const page = await call("GET", `/alerts?state=firing&limit=1000${cursor && `&cursor=${encodeURIComponent(cursor)}`}`);
    found.push(...page.items);
    cursor = page.next_cursor;
  }
  return found
    .filter((alert) => of.has(alert.camera_id) && !alert.group_id && RULE.kinds[alert.kind].takes.includes(wanted))
    .filter((alert) => wanted !== "acknowledge" || !alert.acknowledged)
    .map((alert) => [alert.id, of.get(alert.camera_id)]);
}
