// "3 minutes ago", said anew as time goes on; the same words as service/wording/times.py.

import { _, language } from "./words.js";

const EVERY_MS = 10_000;
const UNITS = [
  ["year", 31_536_000],
  ["month", 2_592_000],
  ["week", 604_800],
  ["day", 86_400],
  ["hour", 3600],
  ["minute", 60],
];
const AT_LEAST = 1.5; // of a unit, to say a length of time in it: "90 minutes", then "2 hours"
const WORDS = new Intl.RelativeTimeFormat(language);

export function ago(iso) {
  const seconds = (Date.parse(iso) - Date.now()) / 1000;
  if (seconds > -30 && seconds <= 60) return _("just now");
  const [unit, size] = UNITS.find(([, size]) => Math.abs(seconds) >= AT_LEAST * size) ?? UNITS.at(-1);
  return WORDS.format(Math.sign(seconds) * Math.max(Math.round(Math.abs(seconds) / size), 1), unit);
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
