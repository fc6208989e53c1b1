// What is wrong with the service, in the head of every page, and that a page is of before it stopped.

import { _ } from "./words.js";

const place = document.getElementById("health");
const EVERY_MS = 30_000;
const clock = new Intl.DateTimeFormat("sv-SE", { timeZone: document.body.dataset.zone, hour: "2-digit", minute: "2-digit" });
let heard = Date.now();

async function look() {
  try {
    const answer = await fetch("/ui/health/banner", { headers: { Accept: "text/html" } });
    if (!answer.ok) return; // logged out: whoever looks for more is told
    heard = Date.now();
    place.innerHTML = await answer.text(); // of our own template, in which all is escaped
  } catch {
    const banner = document.createElement("div");
    banner.className = "banner critical";
    banner.role = "alert";
    banner.textContent = _("The service does not answer. What you see is as of {time}.", { time: clock.format(heard) });
    place.replaceChildren(banner);
  }
}

look();
setInterval(() => document.hidden || look(), EVERY_MS);
document.addEventListener("visibilitychange", () => document.hidden || look());
document.addEventListener("live", look); // the stream of events came, or went (events.js)
