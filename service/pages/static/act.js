// Calls of the JSON API, and what became of them, in words.

import { _, language } from "./words.js";

/** An answer that is no success: `problem` is its document (RFC 9457). */
export class Refused extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.problem = problem;
  }

  /** The reason with the name of its field if there is one reason; else the whole detail. */
  get reason() {
    const errors = this.problem.errors ?? [];
    if (errors.length !== 1) return this.message;
    const [{ pointer, reason }] = errors;
    const field = pointer.split("/").at(-1);
    return /^[a-z]\w*$/.test(field) ? `${field}: ${reason}` : reason;
  }
}

/**
 * The body of the answer to a call, with JSON or a file; null where it has none.
 *
 * Throws Refused for a problem document, and for a service that does not answer.
 */
export async function call(method, url, body, headers = {}) {
  const given = { method, headers: { Accept: "application/json", ...headers } };
  if (body !== undefined) {
    const isFile = body instanceof Blob;
    given.body = isFile ? body : JSON.stringify(body);
    given.headers["Content-Type"] ??= isFile ? body.type : "application/json";
  }
  let answer;
  try {
    answer = await fetch(url, given);
  } catch {
    throw new Refused({ title: _("No answer"), detail: _("The service does not answer. Is it running?") });
  }
  const isJson = answer.status !== 204 && (answer.headers.get("Content-Type") || "").includes("json");
  const document = isJson ? await answer.json() : null;
  if (answer.ok) return document;
  // Of a proxy, say; with HTTP/2 there is no text of a status.
  throw new Refused(document ?? { title: _("Error {status}", { status: answer.status }), detail: answer.statusText });
}

// What a person can do about an answer that programs read.
const PLAIN = {
  401: _("You are not logged in any more. Log in again, in another tab if you have typed much."),
  403: _("You may look, but not do this. Whoever looks after the service can give you the right."),
  409: _("Somebody was faster, or it is not so any more:") + " ",
};

/** A reason as a person says it: without the field's name, what was typed, and times of machines. */
export function plainly(reason, zone = document.body.dataset.zone) {
  const words = reason
    .replace(/^[a-z_.]+: /, "")
    .replace(/(, got (\[.*\]|[^,]*)| \(got .*\))$/, "")
    .replace(/\d{4}-\d\d-\d\dT[\d:.]+(Z|[+-]\d\d:\d\d)/g, (at) =>
      new Intl.DateTimeFormat(language === "en" ? "en-GB" : language, { timeZone: zone, dateStyle: "medium", timeStyle: "short" }).format(new Date(at)),
    );
  return words[0].toUpperCase() + words.slice(1) + (/[.!?]$/.test(words) ? "" : ".");
}

/** Show what was refused and why. */
export function showProblem(error) {
  const { status, detail } = error.problem ?? { detail: String(error) };
  const said = PLAIN[status] ?? "";
  const dialog = document.getElementById("problem");
  document.getElementById("problem-title").textContent = _("That was not done");
  document.getElementById("problem-detail").textContent =
    status === 409 ? said + plainly(detail) : said || plainly(detail || (error.problem?.title ?? _("no reason was given")));
  const reasons = error.problem?.errors?.length > 1 ? error.problem.errors : [];
  document.getElementById("problem-errors").replaceChildren(
    ...reasons.map(({ pointer, reason }) => {
      const item = document.createElement("li");
      item.textContent = `${pointer.slice(1)}: ${plainly(reason)}`;
      return item;
    }),
  );
  if (!dialog.open) dialog.showModal();
}

/** Ask once; true where the answer is yes. */
export function confirmed({ title, detail, yes }) {
  const dialog = document.getElementById("confirm");
  document.getElementById("confirm-title").textContent = title;
  document.getElementById("confirm-detail").textContent = detail;
  document.getElementById("confirm-yes").textContent = yes;
  dialog.returnValue = "no"; // Escape keeps the value of the time before
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true });
  });
}

let fading = null;

/** Say something for a while, aloud for who listens. */
export function announce(words) {
  const place = document.getElementById("announce");
  place.textContent = words;
  clearTimeout(fading);
  fading = setTimeout(() => (place.textContent = ""), 6000);
}

/** Do something with a button's form of waiting, and show what goes wrong. */
export async function guarded(button, what) {
  button?.setAttribute("aria-busy", "true");
  if (button) button.disabled = true;
  try {
    return await what();
  } catch (error) {
    showProblem(error);
    return undefined;
  } finally {
    button?.removeAttribute("aria-busy");
    if (button) button.disabled = false;
    // What is disabled loses the focus, and so would who uses a keyboard.
    const held = document.activeElement;
    const lost = () => document.activeElement === document.body;
    if (button?.isConnected && (lost() || held.closest("dialog:not([open])"))) button.focus();
    // Nor is it with what the act has taken away.
    if (lost()) (document.getElementById("rows") ?? document.getElementById("main")).focus({ preventScroll: true });
  }
}
