// Calls of the JSON API, and what became of them, in words.

/** An answer that is no success: `problem` is its document (RFC 9457). */
export class Refused extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.problem = problem;
  }
}

/**
 * The body of the answer to a call; null where it has none.
 *
 * Throws Refused for a problem document, and for a service that does not answer.
 */
export async function call(method, url, body, headers = {}) {
  const given = { method, headers: { Accept: "application/json", ...headers } };
  if (body !== undefined) {
    given.body = JSON.stringify(body);
    given.headers["Content-Type"] = "application/json";
  }
  let answer;
  try {
    answer = await fetch(url, given);
  } catch {
    throw new Refused({ title: "No answer", detail: "The service does not answer. Is it running?" });
  }
  const isJson = answer.status !== 204 && (answer.headers.get("Content-Type") || "").includes("json");
  const document = isJson ? await answer.json() : null;
  if (answer.ok) return document;
  throw new Refused(document ?? { title: `Error ${answer.status}`, detail: answer.statusText });
}

/** Show what was refused and why. */
export function showProblem(error) {
  const problem = error.problem ?? { title: "Something went wrong", detail: String(error) };
  const dialog = document.getElementById("problem");
  document.getElementById("problem-title").textContent = problem.title;
  document.getElementById("problem-detail").textContent = problem.detail ?? "";
  const reasons = problem.errors?.length > 1 ? problem.errors : [];
  document.getElementById("problem-errors").replaceChildren(
    ...reasons.map(({ pointer, reason }) => {
      const item = document.createElement("li");
      item.textContent = `${pointer.slice(1)}: ${reason}`;
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
  }
}
