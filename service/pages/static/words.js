// Texts of scripts in the page's language: they stand in English in `_`, and a page in another
// language brings what they are there.

const said = JSON.parse(document.getElementById("words")?.textContent ?? "{}");

export const language = document.documentElement.lang;

/** A text, with values in their places. */
export function _(text, values = {}) {
  return (said[text] ?? text).replace(/\{(\w+)\}/g, (place, name) => values[name] ?? place);
}

/** A text of one or of many, with `n` and other values in their places. */
export const _n = (one, many, n, values = {}) => _(n === 1 ? one : many, { n, ...values });

/** A number with so many decimals. */
export function number(value, digits) {
  return value.toLocaleString(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
}
