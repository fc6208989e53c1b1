"""Lines as SVG path data: cut to a frame, without points that nobody would miss."""

from collections.abc import Iterable
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
    return "".join(
        "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in _thinned(run).tolist())
        for line in lines
        for run in _runs(line, frame)
    )


def _runs(line: Array, frame: Frame) -> list[Array]:
    """The parts of a line within a frame, (N, 2) each.

    Source: Liang and Barsky, "A New Concept and Method for Line Clipping", 1984.
    """
    start, step = line[:-1], np.diff(line, axis=0)
    low, high = (frame.left, frame.top), (frame.right, frame.bottom)
    level = step == 0.0  # along an edge: within it or never
    beside = np.where((low <= start) & (start <= high), -2.0, 2.0)
    slope = np.where(level, 1.0, step)
    edges = (low - start) / slope, (high - start) / slope
    enters = np.where(level, beside, np.minimum(*edges)).max(1).clip(min=0.0)[:, None]
    leaves = np.where(level, -beside, np.maximum(*edges)).min(1).clip(max=1.0)[:, None]
    firsts = np.where(enters == 0.0, start, start + enters * step)
    lasts = np.where(leaves == 1.0, line[1:], start + leaves * step)
    (seen,) = np.nonzero((enters <= leaves)[:, 0])  # never of a NaN
    breaks = (np.diff(seen) > 1) | (firsts[seen[1:]] != lasts[seen[:-1]]).any(1)
    segments = np.split(seen, np.flatnonzero(breaks) + 1) if len(seen) else []
    return [np.concatenate([firsts[some[:1]], lasts[some]]) for some in segments]


def _thinned(run: Array) -> Array:
    """The run (N, 2) without points near the chord of what is kept; a bow keeps its points.

    Source: Douglas and Peucker, "Algorithms for the Reduction of the Number of Points Required to
    Represent a Digitized Line", 1973.
    """
    kept = np.zeros(len(run), bool)
    kept[[0, -1]] = True
    spans = [(0, len(run) - 1)]
    while spans:  # no recursion: a zigzag that grows is as deep as it is long
        first, last = spans.pop()
        chord, between = run[last] - run[first], run[first + 1 : last] - run[first]
        length = float(np.hypot(*chord))
        across = between[:, 0] * chord[1] - between[:, 1] * chord[0]
        off = np.abs(across) / length if length else np.hypot(*between.T)
        if last - first > 1 and off.max() > _STRAIGHT_PX:
            farthest = first + 1 + int(off.argmax())
            kept[farthest] = True
            spans += [(first, farthest), (farthest, last)]
    return run[kept]
