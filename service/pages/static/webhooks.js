// Webhooks: tested, switched off and on, given a secret, removed, added; the page then loads anew.

import { call, confirmed } from "./act.js";
import { listen } from "./alert_actions.js";
import { showErrors } from "./dialogs.js";
import { _ } from "./words.js";

const root = document.getElementById("main");
const path = (button) => `/webhooks/${button.closest("[data-id]").dataset.id}`;
const nameOf = (button) => button.closest("[data-id]").dataset.name;

function showSecret(secret) {
  if (!secret) return location.reload(); // an Alertmanager has none
  document.getElementById("secret-text").textContent = secret;
  document.getElementById("secret").hidden = false;
  document.getElementById("secret").scrollIntoView({ block: "center" });
}

async function then(what) {
  await what;
  location.reload();
}

listen(root, {
  test: (said, button) => then(call("POST", `${path(button)}/test`)),
  off: (said, button) => then(call("PATCH", path(button), { enabled: false })),
  on: (said, button) => then(call("PATCH", path(button), { enabled: true })),
  replay: ({ delivery }) => then(call("POST", `/deliveries/${delivery}/replay`)),

  async secret(said, button) {
    const detail = _("For a day, messages are signed with the old one, too. Then it counts no more.");
    if (await confirmed({ title: _("A new secret for {name}?", { name: nameOf(button) }), detail, yes: _("Make it") })) {
      showSecret((await call("POST", `${path(button)}/secret`)).secret);
    }
  },

  async remove(said, button) {
    const detail = _("Nobody is told there any more, and what was sent is forgotten.");
    if (await confirmed({ title: _("Remove {name}?", { name: nameOf(button) }), detail, yes: _("Remove it") })) {
      await then(call("DELETE", path(button)));
    }
  },
});

const form = document.getElementById("add");
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  showErrors(form, null);
  try {
    showSecret((await call("POST", "/webhooks", Object.fromEntries(new FormData(form)))).secret);
  } catch (error) {
    showErrors(form, error);
  }
});
