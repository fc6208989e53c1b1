// What pages ask before they act: dialogs, whose form stays open until it is taken, and a name, once.

import { Refused, call, plainly } from "./act.js";
import { zone } from "./zoned.js";

const KEY = "surefoot.by";

/** Who is logged in, and so who acts; undefined where access is off. */
export const caller = document.body.dataset.caller;

/** The name that acts are kept with; empty where nobody has said one. */
export function myName() {
  if (caller) return caller;
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return ""; // storage may be forbidden
  }
}

/** Ask for a name unless one was given before; false where the act is called off. */
export async function nameMe({ again = false } = {}) {
  if (caller || (!again && asked())) return true;
  document.getElementById("name-field").value = myName();
  const said = await ask("name-dialog", { keep: true });
  if (!said) return false;
  try {
    localStorage.setItem(KEY, said.by.trim());
  } catch {
    // then it is asked for again
  }
  return true;
}

function asked() {
  try {
    return localStorage.getItem(KEY) !== null;
  } catch {
    return false;
  }
}

/** A call in somebody's name, which is asked for once; undefined where it is called off. */
export async function signed(method, url, body = {}) {
  if (!(await nameMe())) return undefined;
  return call(method, url, myName() ? { ...body, by: myName() } : body);
}

/**
 * What was said in a dialog's form, by the names of its fields; null where it was called off.
 *
 * With `send`, that is done before the dialog closes: what it refuses is said beside the fields, and
 * what was typed stays.
 */
export function ask(id, { keep = false, send = async () => true } = {}) {
  const dialog = document.getElementById(id);
  const form = dialog.querySelector("form");
  if (!keep) form.reset();
  showErrors(form, null);
  form.dispatchEvent(new Event("change"));
  dialog.returnValue = "no"; // Escape keeps the value of the time before
  dialog.showModal();
  return new Promise((resolve) => {
    let said = null;
    const submit = async (event) => {
      if (event.submitter?.value !== "yes") return;
      event.preventDefault();
      event.submitter.disabled = true;
      try {
        const values = Object.fromEntries(new FormData(form));
        if ((await send(values)) === undefined) return;
        said = values;
        dialog.close();
      } catch (error) {
        showErrors(form, error);
      } finally {
        event.submitter.disabled = false;
      }
    };
    form.addEventListener("submit", submit);
    const close = () => {
      form.removeEventListener("submit", submit);
      resolve(said);
    };
    dialog.addEventListener("close", close, { once: true });
  });
}

/** The words of a text, with blanks or commas between them. */
export const wordsIn = (text) => text.split(/[\s,]+/).filter(Boolean);

/** Say beside each field what is wrong with it, and below them what is of none. */
export function showErrors(form, error) {
  const places = [...form.querySelectorAll("[data-error]")];
  for (const place of places) {
    place.textContent = "";
    form.elements[place.dataset.error]?.removeAttribute("aria-invalid");
  }
  if (!error) return;
  const reasons = error instanceof Refused ? (error.problem.errors ?? []) : [];
  const fields = reasons.map(({ pointer, reason }) => [pointer.split("/")[1], plainly(reason, zone)]);
  const named = fields.filter(([name]) => places.some((each) => each.dataset.error === name));
  for (const [name, words] of named) {
    places.find((each) => each.dataset.error === name).textContent = words;
    form.elements[name].setAttribute("aria-invalid", "true");
  }
  if (named.length) form.elements[named[0][0]].focus();
  else places.at(-1).textContent = plainly(error.message, zone);
}

// A time is only asked for where it counts.
const silence = document.querySelector("#silence-dialog form");
silence?.addEventListener("change", () => {
  const until = silence.elements.until;
  until.disabled = silence.elements.how.value !== "date";
  until.required = !until.disabled;
});

// Enter in a form is a yes, though Cancel comes first in it.
for (const form of document.querySelectorAll("dialog form")) {
  form.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || event.target.tagName === "BUTTON") return;
    const yes = form.querySelector('button[value="yes"]');
    if (!yes) return;
    event.preventDefault();
    form.requestSubmit(yes);
  });
}
