// Asks each second where to turn the camera; an arrow says it, and so do words.

import { Refused, announce, call, guarded } from "./act.js";
import { _, number } from "./words.js";

const root = document.getElementById("aim");
const path = `/cameras/${encodeURIComponent(root.dataset.camera)}`;
const EVERY_MS = 1000, PEOPLE_MS = 5000;
const SMALL_DEG = 0.1; // not worth a word
let last = null;

/** How far to turn, in words: "0.8° more to the left, 0.3° up". */
function inWords({ right_deg: right, up_deg: up, clockwise_deg: clockwise }) {
  const parts = [
    [right, _("{deg}° more to the right"), _("{deg}° more to the left")],
    [up, _("{deg}° up"), _("{deg}° down")],
    [clockwise, _("{deg}° clockwise"), _("{deg}° counterclockwise")],
  ];
  const said = parts
    .filter(([deg]) => Math.abs(deg) >= SMALL_DEG)
    .map(([deg, plus, minus]) => _(deg > 0 ? plus : minus, { deg: number(Math.abs(deg), 1) }));
  return said.join(", ") || _("A little");
}

function show(aim) {
  last = aim;
  const known = aim.right_deg !== null;
  root.dataset.state = !known ? "unknown" : aim.good ? "good" : "turn";
  const words = !known ? _("Nothing tells: the picture matches none of before.") : aim.good ? _("It looks where it did.") : inWords(aim);
  const place = document.getElementById("aim-words");
  if (place.textContent !== words) place.textContent = words;
  document.getElementById("aim-by").textContent = aim.by_picture
    ? _("By the picture of now.")
    : _("By the newest people: it takes some of them to tell. Send pictures to see it at once.");
  if (!known) return;
  const deg = (Math.atan2(aim.right_deg, aim.up_deg) * 180) / Math.PI;
  document.getElementById("aim-arrow").setAttribute("transform", `rotate(${deg.toFixed(0)})`);
}

async function ask() {
  let wait = EVERY_MS;
  try {
    if (!document.hidden) {
      const aim = await call("POST", `${path}/aim`);
      show(aim);
      if (!aim.by_picture) wait = PEOPLE_MS;
    }
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    // Another page aims the same camera at this moment; the aim that is shown is a second old.
    if (error.problem.code === "too_many_requests") return setTimeout(ask, EVERY_MS);
    root.dataset.state = "unknown";
    document.getElementById("aim-words").textContent = error.message;
    wait = PEOPLE_MS;
  }
  setTimeout(ask, wait);
}

const done = document.getElementById("aim-done");
done.addEventListener("click", () =>
  guarded(done, async () => {
    const note = last?.right_deg == null ? "" : last.good ? _("aimed: within {deg}°", { deg: number(0.2, 1) }) : _("aimed: {left} was left", { left: inWords(last) });
    await call("POST", `${path}/pose/put-back`, note ? { note } : {});
    announce(_("Put back. The next people, or pictures, tell."));
    location.assign(`/ui${path}`);
  }),
);

ask();
