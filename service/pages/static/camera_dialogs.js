// What the page of a camera asks before it acts: dialogs of its own, and a name, once.

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

/** What was said in a dialog's form, by the names of its fields; null where it was called off. */
export function ask(id, { keep = false, needsPose = true } = {}) {
  const dialog = document.getElementById(id);
  const form = dialog.querySelector("form");
  if (!keep) form.reset();
  for (const each of dialog.querySelectorAll("[data-needs-pose]")) {
    each.hidden = !needsPose;
  }
  form.dispatchEvent(new Event("change"));
  dialog.returnValue = "no"; // Escape keeps the value of the time before
  dialog.showModal();
  return new Promise((resolve) => {
    const close = () =>
      resolve(dialog.returnValue === "yes" ? Object.fromEntries(new FormData(form)) : null);
    dialog.addEventListener("close", close, { once: true });
  });
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
