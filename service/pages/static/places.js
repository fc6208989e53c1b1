// Sites and tags of the fleet as chips: one step into the site that is asked for, and all steps out.

import { _ } from "./words.js";

const MOST = 24; // of sites, and of tags; of more, the search finds the others

const said = new Map(); // places are few, cameras many

/** The site and the tags that a place says, such as "campus/north #outdoor". */
export function placed(place) {
  if (!said.has(place)) {
    const [site, ...tags] = place.split("#").map((word) => word.trim());
    said.set(place, { site, tags });
  }
  return said.get(place);
}

/** True of a camera that lies at a site or below it and has all of some tags. */
export function within({ site, tags }, wanted) {
  if (!wanted.site && !wanted.tags.size) return true;
  const inside = !wanted.site || site === wanted.site || site.startsWith(`${wanted.site}/`);
  return inside && [...wanted.tags].every((tag) => tags.includes(tag));
}

let shown = "";

/** Show the chips, with how many of their cameras need a person; focus stays on its chip. */
export function showPlaces(box, cameras, wanted) {
  const found = cameras.filter((camera) => within(camera, wanted));
  const steps = wanted.site ? wanted.site.split("/") : [];
  const start = steps.length ? `${wanted.site}/` : "";
  const below = counted(found, ({ site }) => {
    const rest = site.startsWith(start) ? site.slice(start.length) : "";
    return rest ? [start + rest.split("/")[0]] : [];
  });
  const tagged = counted(found, ({ tags }) => tags);
  for (const tag of wanted.tags) if (!tagged.some(([name]) => name === tag)) tagged.push([tag, 0, 0]);
  const news = JSON.stringify([wanted.site, below, tagged, ...wanted.tags]);
  if (news === shown) return; // a chip that is being pressed stays
  shown = news;
  const out = steps.map((word, at) => chip("site", steps.slice(0, at + 1).join("/"), word));
  if (steps.length) out.unshift(chip("site", "", _("All sites")));
  out.at(-1)?.setAttribute("aria-pressed", "true");
  const chips = [
    ...out,
    ...below.map(([site, ...counts]) => chip("site", site, site.slice(start.length), counts)),
    ...tagged.map(([tag, ...counts]) => {
      const made = chip("tag", tag, `#${tag}`, counts);
      made.setAttribute("aria-pressed", String(wanted.tags.has(tag)));
      return made;
    }),
  ];
  const held = box.contains(document.activeElement) ? { ...document.activeElement.dataset } : null;
  box.replaceChildren(...chips);
  box.hidden = !chips.length;
  if (held) (chips.find(({ dataset }) => dataset.site === held.site && dataset.tag === held.tag) ?? chips[0])?.focus();
}

/** What names cameras: `[name, cameras, of them need a person]`, those first that need one most. */
function counted(cameras, namesOf) {
  const counts = new Map();
  for (const camera of cameras) {
    for (const name of namesOf(camera)) {
      const [all, due] = counts.get(name) ?? [0, 0];
      counts.set(name, [all + 1, due + (camera.waiting > 0)]);
    }
  }
  const rows = [...counts].map(([name, [all, due]]) => [name, all, due]);
  return rows.sort((a, b) => b[2] - a[2] || (a[0] < b[0] ? -1 : 1)).slice(0, MOST);
}

function chip(kind, value, words, [all, due] = []) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = "chip";
  made.dataset[kind] = value;
  made.append(words);
  if (all) made.append(part("span", "soft", String(all)));
  if (due) made.append(part("b", "due", String(due)), part("span", "hidden-words", due === 1 ? _("needs a person") : _("need a person")));
  return made;
}

function part(name, kind, words) {
  const made = document.createElement(name);
  made.className = kind;
  made.textContent = words;
  return made;
}
