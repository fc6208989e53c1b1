"""Lines as SVG path data: cut to a frame, without points that nobody would miss."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from models.geometry.rotation import Array

_STRAIGHT_PX = 0.25  # a point that is nearer to its neighbours' line is left out


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A rectangle that drawings are cut to."""

    left: float
    top: float
    right: float
    bottom: float


def svg(kind: str, view_box: str, label: str, parts: Iterable[str]) -> Markup:
    """A drawing of parts that are SVG already; the label is what a screen reader says of it."""
    return Markup(
        f'<svg class="{kind}" viewBox="{view_box}" role="img" aria-label="{escape(label)}">'
        f"{''.join(parts)}</svg>"
    )


def path_data(lines: Iterable[Array], frame: Frame) -> str:
    """The `d` of a path of polylines (N, 2), cut to a frame; NaN points break a line."""
    parts = []
    for line in lines:
        for run in _runs(line, frame):
            kept = _thinned(run)
            parts.append("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in kept))
    return "".join(parts)


def _runs(line: Array, frame: Frame) -> Iterator[list[tuple[float, float]]]:
    run: list[tuple[float, float]] = []
    for start, end in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
        cut = _cut(start, end, frame)
        if cut is None:
            if run:
                yield run
            run = []
            continue
        if run and run[-1] != cut[0]:
            yield run
            run = []
        run = [*run, cut[1]] if run else [*cut]
    if run:
        yield run


def _cut(
    start: list[float], end: list[float], frame: Frame
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """The part of a segment within a frame, or None.

    Source: Liang and Barsky, "A New Concept and Method for Line Clipping", 1984.
    """
    (x, y), (to_x, to_y) = start, end
    across, down = to_x - x, to_y - y
    if not np.isfinite(across + down):
        return None
    enters, leaves = 0.0, 1.0
    for step, room in (
        (-across, x - frame.left),
        (across, frame.right - x),
        (-down, y - frame.top),
        (down, frame.bottom - y),
    ):
        if step == 0.0:
            if room < 0:
                return None
        elif step < 0:
            enters = max(enters, room / step)
        else:
            leaves = min(leaves, room / step)
    if enters > leaves:
        return None
    first = (x, y) if enters == 0.0 else (x + enters * across, y + enters * down)
    last = (to_x, to_y) if leaves == 1.0 else (x + leaves * across, y + leaves * down)
    return first, last


def _thinned(run: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The run without points on the line of what is kept; a bow is followed by its points."""
    if len(run) < 3:
        return run
    points = np.array(run)
    kept, first = [run[0]], 0
    for last in range(2, len(run)):
        chord = points[last] - points[first]
        length = float(np.hypot(*chord)) or 1.0
        between = points[first + 1 : last] - points[first]
        off = np.abs(between[:, 0] * chord[1] - between[:, 1] * chord[0]) / length
        if off.max() > _STRAIGHT_PX:
            first = last - 1
            kept.append(run[first])
    return [*kept, run[-1]]
