// Places in a picture that a person points at: by mouse or finger, or by the arrows of a keyboard.

const NEAR_PX = 3; // of the screen: a tap, and no drag
const STEP = 1 / 200; // of a picture's width, by an arrow
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** The pixel of a drawing's picture that an event is at, kept within its edges. */
export function pixel(event, svg) {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return within([at.x, at.y], svg);
}

function within([u, v], svg) {
  const { x, y, width, height } = svg.viewBox.baseVal;
  const kept = [Math.min(Math.max(u, x), x + width), Math.min(Math.max(v, y), y + height)];
  return kept.map((value) => Math.round(value * 10) / 10);
}

/** Where an arrow moves a place to, with Shift by one pixel; null of other keys. */
export function stepped(event, [u, v], svg) {
  const way = WAYS[event.key];
  if (!way) return null;
  event.preventDefault();
  const far = event.shiftKey ? 1 : Math.max(1, Math.round(svg.viewBox.baseVal.width * STEP));
  return within([u + far * way[0], v + far * way[1]], svg);
}

/** Call `begin(at, target)` when somebody presses, and unless that is false, `move(at)` as they drag. */
export function drags(svg, begin, move) {
  let begun = null;
  svg.addEventListener("pointerdown", (event) => {
    if (event.button > 0 || begin(pixel(event, svg), event.target) === false) return;
    event.preventDefault(); // a finger draws, and does not scroll
    svg.setPointerCapture(event.pointerId);
    begun = { at: [event.clientX, event.clientY], far: false };
  });
  svg.addEventListener("pointermove", (event) => {
    if (!begun) return;
    begun.far ||= Math.hypot(event.clientX - begun.at[0], event.clientY - begun.at[1]) >= NEAR_PX;
    if (begun.far) move(pixel(event, svg));
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => (begun = null));
}

/** An SVG element in another. */
export function shape(place, name, attributes) {
  const made = document.createElementNS(place.namespaceURI, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  place.append(made);
  return made;
}

/** Marks of one or two points each, in place of those that were drawn; of two, a line. */
export function drawMarks(place, marks) {
  place.replaceChildren();
  for (const { points, made, label } of marks.filter((mark) => mark.points.length)) {
    const end = points[1] ?? [points[0][0] + 0.1, points[0][1]];
    shape(place, "polyline", { class: `mark ${made ? "new" : ""} ${points[1] ? "" : "spot"}`, points: `${points[0]} ${end}` });
    if (!label) continue;
    const [x, y] = points[0];
    const size = place.ownerSVGElement.viewBox.baseVal.width / 40;
    shape(place, "text", { class: "mark-name", x: x + size / 2, y: y - size / 3, "font-size": size }).textContent = label;
  }
}

export const corners = (points) => points.map((at) => at.join(",")).join(" ");
