// "3 min ago", said anew as time goes on; the same words as service/web/words.py.

const EVERY_MS = 10_000;

function duration(seconds) {
  if (seconds < 90) return `${Math.round(Math.max(seconds, 0))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  if (seconds < 129_600) return `${Math.round(seconds / 3600)} h`;
  return `${Math.round(seconds / 86_400)} days`;
}

export function ago(iso) {
  const seconds = (Date.now() - Date.parse(iso)) / 1000;
  if (seconds < -60) return `in ${duration(-seconds)}`;
  return seconds < 10 ? "just now" : `${duration(seconds)} ago`;
}

/** Keep every <time> within some elements true. */
export function keepTimes(...places) {
  setInterval(() => {
    if (document.hidden) return;
    for (const place of places) {
      for (const time of place.querySelectorAll("time[datetime]:not([data-fixed])")) {
        const words = ago(time.dateTime);
        if (time.textContent !== words) time.textContent = words;
      }
    }
  }, EVERY_MS);
}
