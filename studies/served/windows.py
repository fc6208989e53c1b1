"""Tracks as they come to the service: in batches, the newest of them, from the newest change on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from models.assessment import (
    Assessment,
    AssessmentLimits,
    AssessmentState,
    TrackWindow,
    assess,
    next_state,
)
from models.durations import DAY_S
from models.errors import TooFewTrajectoriesError
from models.pose import CameraSite, Trajectory

_LIMITS = AssessmentLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Window of an assessment: the newest tracks, of so many days; and how often it is made.

    After each batch of `batch` tracks; with None, once they all are there.
    """

    tracks: int = 400
    days: float = 7.0
    batch: int | None = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class AssessedWindow:
    """An assessment after `tracks` tracks had come: of those from the number `first` on.

    `cut` is the number of the first track after a change that was found.
    """

    tracks: int
    first: int
    assessment: Assessment
    cut: int | None


def assessed_windows(
    tracks: Sequence[Trajectory],
    site: CameraSite,
    window: Window,
    limits: AssessmentLimits = _LIMITS,
) -> Iterator[AssessedWindow]:
    """Assess tracks that come in the order of their ends, as the service does.

    Once a change is found, no window reaches back beyond it. Windows of fewer than five people who
    walk are skipped.

    Raises:
        Exception: the error of a part that the service would have done without. In a study it is a
            fault.
    """
    ended_s = np.array([track.time_s[-1] for track in tracks])
    from_s, state = -np.inf, AssessmentState()
    step = window.batch or max(len(tracks), 1)
    for came in [*range(step, len(tracks), step), len(tracks)]:
        if not came:
            return
        oldest_s = max(from_s, float(ended_s[came - 1]) - window.days * DAY_S)
        since = int(np.searchsorted(ended_s[:came], oldest_s, side="left"))
        first = max(since, came - window.tracks)
        try:
            found = assess(TrackWindow(trajectories=tracks[first:came]), site, state, limits)
        except TooFewTrajectoriesError:
            continue
        if found.failures:
            raise found.failures[0].error
        state = next_state(state, found)
        at = found.estimated.change_idx
        cut = None if at is None else first + at
        if cut is not None:
            from_s = float(ended_s[cut])
        yield AssessedWindow(tracks=came, first=first, assessment=found, cut=cut)
