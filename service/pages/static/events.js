// What happens, as it happens: one EventSource a page, which comes back by itself.

import { _ } from "./words.js";

const TYPES = ["pose", "alert", "training"];
const AGAIN_MS = 3000;
const LEAVING_MS = 250; // until a page that is being left is gone

/**
 * Call `onEvent({type, id, data})` for each event after the one that the page was made at.
 *
 * A hidden page lets go of its connection, since a browser has only six for a host, and takes up
 * where it was when it is seen again. Returns a function that ends it all.
 */
export function subscribe(onEvent, onState = showState) {
  let source = null;
  let timer = null;
  let lost = null;
  let seen = document.querySelector('meta[name="newest-event"]')?.content ?? "";

  const close = () => {
    clearTimeout(timer);
    clearTimeout(lost);
    source?.close();
    source = null;
  };
  const open = () => {
    close();
    source = new EventSource("/events" + (seen ? `?after=${encodeURIComponent(seen)}` : ""));
    source.onopen = () => {
      clearTimeout(lost);
      onState("on");
    };
    // A page that is being left loses its connection, too: it would tell so, and ask why.
    source.onerror = () => {
      clearTimeout(lost);
      lost = setTimeout(broken, LEAVING_MS);
    };
    for (const type of TYPES) {
      source.addEventListener(type, (event) => {
        seen = event.lastEventId || seen;
        onEvent({ type, id: event.lastEventId, data: JSON.parse(event.data) });
      });
    }
  };
  const broken = () => {
    onState("off");
    // The browser tries again by itself unless the answer was an error.
    if (source?.readyState !== EventSource.CLOSED) return;
    timer = setTimeout(open, AGAIN_MS);
    leaveIfLoggedOut().catch(() => {});
  };
  const onVisibility = () => (document.hidden ? close() : open());
  document.addEventListener("visibilitychange", onVisibility);
  window.addEventListener("pagehide", close);
  window.addEventListener("pageshow", (event) => event.persisted && open());
  open();
  return () => {
    document.removeEventListener("visibilitychange", onVisibility);
    close();
  };
}

/** Load the page anew, which leads to the login, where its session is over. */
async function leaveIfLoggedOut() {
  const answer = await fetch("/cameras?limit=1", { headers: { Accept: "application/json" } });
  if (answer.status === 401) location.reload();
}

/** Show in the page's head whether it is live. */
export function showState(state) {
  const place = document.getElementById("live");
  if (!place || (place.dataset.state === state && !place.hidden)) return;
  document.dispatchEvent(new CustomEvent("live"));
  place.hidden = false;
  place.dataset.state = state;
  place.querySelector(".live-words").textContent = state === "on" ? _("Live") : _("Reconnecting…");
}

/** A function that calls `what` once with all that was given within `wait_ms` of the first. */
export function gathered(what, wait_ms) {
  let waiting = null;
  return (item) => {
    if (waiting) return void waiting.push(item);
    waiting = [item];
    setTimeout(() => {
      const items = waiting;
      waiting = null;
      what(items);
    }, wait_ms);
  };
}

/** A function that calls `what` when it has not been called for `wait_ms`. */
export function debounced(what, wait_ms) {
  let timer = null;
  return (...given) => {
    clearTimeout(timer);
    timer = setTimeout(() => what(...given), wait_ms);
  };
}
