// Times as they are typed and said: all of a page by one zone, the service's.

export const zone = document.body.dataset.zone;

const FIELDS = { year: "numeric", month: "2-digit", day: "2-digit", hour: "2-digit", minute: "2-digit", second: "2-digit" };
const clock = new Intl.DateTimeFormat("sv-SE", { timeZone: zone, ...FIELDS });

/** How far the zone is ahead of UTC at a moment, in ms. */
const ahead = (ms) => Date.parse(`${clock.format(ms).replace(" ", "T")}Z`) - Math.floor(ms / 1000) * 1000;

/** The moment of a time that was typed without a zone, as RFC 3339. */
export function instant(typed) {
  const as_utc = Date.parse(`${typed}Z`);
  const near = as_utc - ahead(as_utc);
  return new Date(as_utc - ahead(near)).toISOString(); // once more, for a change of the clock
}

/** Tomorrow at eight, as RFC 3339. */
export function tomorrow() {
  const day = clock.format(Date.now() + 86_400_000).slice(0, 10);
  return instant(`${day}T08:00:00`);
}
