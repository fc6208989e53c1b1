// The wall: what needs a person, how old that is, and a sound for what is new.

import { gathered, subscribe } from "./events.js";
import { keepTimes } from "./times.js";
import { _ } from "./words.js";
import { zone } from "./zoned.js";

const EVERY_MS = 10_000;
const OLD_S = 30; // three looks that failed
const clock = new Intl.DateTimeFormat("sv-SE", { timeZone: zone, hour: "2-digit", minute: "2-digit", second: "2-digit" });
const wall = document.getElementById("wall");
const age = document.getElementById("age");
const sound = document.getElementById("sound");
const idsOf = () => wall.dataset.waiting.split(" ").filter(Boolean);

let heard = performance.now(); // a clock that nobody sets
let live = true;
let known = new Set(idsOf());
let audio = null;

async function refresh() {
  const answer = await fetch(location.href, { headers: { Accept: "text/html" }, signal: AbortSignal.timeout(EVERY_MS) });
  if (answer.redirected) return location.reload(); // to the login
  if (!answer.ok) return;
  const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
  const made = fresh.getElementById("wall");
  wall.replaceChildren(...made.childNodes);
  Object.assign(wall.dataset, made.dataset);
  document.title = fresh.title;
  heard = performance.now();
  const ids = idsOf();
  if (ids.some((id) => !known.has(id))) beep();
  known = new Set(ids);
  say();
}

function say() {
  const seconds = Math.round((performance.now() - heard) / 1000);
  const stopped = !live || seconds > OLD_S;
  age.dataset.stopped = stopped;
  const at = { time: clock.format(Date.parse(wall.dataset.made)), seconds };
  age.textContent = stopped ? _("Stopped: as of {time}, {seconds} s ago", at) : _("As of {time}, {seconds} s ago", at);
  document.getElementById("stopped").hidden = !stopped;
}

/** Two tones, as long as the sound is on. */
function beep() {
  if (!audio) return;
  for (const [hertz, after_s] of [[660, 0], [880, 0.25]]) {
    const tone = new OscillatorNode(audio, { frequency: hertz });
    tone.connect(new GainNode(audio, { gain: 0.2 })).connect(audio.destination);
    tone.start(audio.currentTime + after_s);
    tone.stop(audio.currentTime + after_s + 0.2);
  }
}

sound.addEventListener("click", () => {
  audio?.close();
  audio = audio ? null : new AudioContext(); // a browser allows it after a click alone
  sound.setAttribute("aria-pressed", Boolean(audio));
  sound.textContent = audio ? _("Sound: on") : _("Sound: off");
  beep();
});

const again = () => refresh().catch(console.warn);
const soon = gathered(again, 300);
subscribe(
  (event) => event.type === "alert" && soon(event),
  (state) => {
    if (state === "on" && !live) again();
    live = state === "on";
    say();
  },
);
say();
setInterval(say, 1000);
setInterval(again, EVERY_MS);
keepTimes(wall);
