// What is said of a camera is changed, and the camera deleted, in dialogs: each of the version that
// was read as they opened.

import { Refused, call } from "./act.js";
import { done, listen } from "./alert_actions.js";
import { ask, myName, nameMe, wordsIn } from "./dialogs.js";
import { _ } from "./words.js";

const root = document.getElementById("camera");
const path = `/cameras/${encodeURIComponent(root.dataset.camera)}`;

/** The camera as it is stored now, and the version that this is. */
async function stored() {
  const answer = await fetch(path, { headers: { Accept: "application/json" } });
  const document_ = await answer.json();
  if (!answer.ok) throw new Refused(document_);
  return { camera: document_, etag: answer.headers.get("ETag") };
}

/** Send a change of a version; one that was changed meanwhile may be sent again. */
async function send(version, method, url, body) {
  try {
    return await call(method, url, body, { "If-Match": version.etag });
  } catch (error) {
    if (error.problem?.status !== 412) throw error;
    version.etag = error.problem.etag;
    throw new Refused({ detail: _("somebody changed it meanwhile; once more, and it is done all the same") });
  }
}

const fieldsOf = (id) => document.querySelector(`#${id} form`).elements;

async function edit() {
  const version = await stored();
  const { name, site, tags } = version.camera;
  const typed = { name, site: site ?? "", tags: tags.join(" ") };
  for (const [field, value] of Object.entries(typed)) fieldsOf("edit-dialog")[field].value = value;
  return ask("edit-dialog", {
    keep: true,
    async send(said) {
      const body = Object.fromEntries(Object.entries(said).filter(([field, value]) => value !== typed[field]));
      if (!Object.keys(body).length) return said;
      if (!(await nameMe())) return undefined;
      if ("tags" in body) body.tags = wordsIn(body.tags);
      if (myName()) body.by = myName();
      return done(_("Changed."), send(version, "PATCH", path, body));
    },
  });
}

async function remove() {
  const version = await stored();
  const { name } = version.camera;
  document.getElementById("remove-name").textContent = name;
  const gone = await ask("remove-dialog", {
    async send({ typed }) {
      if (typed.trim() !== name.trim()) throw new Refused({ errors: [{ pointer: "/typed", reason: _("its name, {name}, is needed", { name }) }] });
      if (!(await nameMe())) return undefined;
      const who = myName() ? `?by=${encodeURIComponent(myName())}` : "";
      return send(version, "DELETE", path + who);
    },
  });
  if (gone) location.assign("/");
}

/** Answer the question about the image size of the camera's tracks by a change of the camera. */
async function answerImageSize({ change }) {
  if (!(await nameMe())) return;
  const body = JSON.parse(change);
  if (myName()) body.by = myName();
  await done(_("Answered."), send(await stored(), "PATCH", path, body));
}

listen(root, { edit, remove, "image-size": answerImageSize });
