// A shift is handed over with a note; it is taken over on the page of all cameras (fleet.js).

import { guarded } from "./act.js";
import { signed } from "./dialogs.js";

const form = document.getElementById("handover");
form?.addEventListener("submit", (event) => {
  event.preventDefault();
  guarded(event.submitter, async () => {
    const note = form.elements.note.value.trim();
    const body = { since: form.dataset.since, ...(note && { note }) };
    if ((await signed("POST", "/handovers", body)) !== undefined) location.assign("/");
  });
});
