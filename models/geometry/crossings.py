"""Who crosses a line in the picture, and who would be counted by one that lies wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array, Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossings:
    """People who `crossed` a line, those of them who were `missed`, and `false_counts` beside them.

    A person counts once, whichever way and how often they cross.
    """

    crossed: int
    missed: int
    false_counts: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """All steps of people, who are numbered: from pixels (N, 2) to pixels (N, 2), by whom (N,)."""

    begins: Array
    ends: Array
    walkers: npt.NDArray[np.int64]
    people: int

    @classmethod
    def of(cls, feet: Sequence[Array]) -> Self:
        """The steps of people by their feet (N, 2) in the order of time, straight in between."""
        walked = [uv for uv in feet if len(uv) > 1]
        nothing = np.zeros((0, 2))
        return cls(
            begins=np.concatenate([nothing, *(uv[:-1] for uv in walked)]),
            ends=np.concatenate([nothing, *(uv[1:] for uv in walked)]),
            walkers=np.repeat(np.arange(len(walked)), [len(uv) - 1 for uv in walked]),
            people=len(walked),
        )

    def crossing(self, line: Array) -> Mask:
        """Who (people,) crosses a line of two ends (2, 2); nobody does one of fewer or no length.

        A foot on the line is on its right, seen from the first end: nobody crosses it twice there.
        """
        crossed = np.zeros(self.people, dtype=bool)
        if len(line) < 2:
            return crossed
        begin, along = line[0], line[-1] - line[0]
        before, after = (
            along[0] * (at[:, 1] - begin[1]) - along[1] * (at[:, 0] - begin[0])
            for at in (self.begins, self.ends)
        )
        there = np.flatnonzero((before >= 0) != (after >= 0))
        share = before[there] / (before[there] - after[there])
        met = self.begins[there] + share[:, None] * (self.ends[there] - self.begins[there])
        at = (met - begin) @ along
        within = (at >= 0) & (at <= along @ along)
        crossed[self.walkers[there[within]]] = True
        return crossed


def crossings(steps: Steps, drawn: Array, now: Array) -> Crossings:
    """How people are counted by a line as it was `drawn`, which by `now` should lie elsewhere."""
    counted, true = steps.crossing(drawn), steps.crossing(now)
    return Crossings(
        crossed=int(true.sum()),
        missed=int((true & ~counted).sum()),
        false_counts=int((counted & ~true).sum()),
    )
