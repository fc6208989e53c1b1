"""Tracks as they come to the service: in batches, the newest of them, from the newest change on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from models.durations import DAY_S
from models.pose import CameraSite, Observations, PoseFinding, Trajectory, observe
from models.tracks.observations import of_tracks
from models.walking.config import FEWEST_WALKERS
from studies.protocol.served import served_pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Window of an estimate: the newest tracks, of so many days; and how often it is made.

    After each batch of `batch` tracks; of None, once they all are there.
    """

    tracks: int = 400
    days: float = 7.0
    batch: int | None = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """An estimate after `tracks` tracks had come: of those from the number `first` on.

    `seen` are these, and `cut` the number of the first track after a change that was found.
    """

    tracks: int
    first: int
    seen: Observations
    finding: PoseFinding
    cut: int | None


def looks(
    tracks: Sequence[Trajectory],
    site: CameraSite,
    window: Window,
) -> Iterator[Look]:
    """The estimates of tracks that come in the order of their ends, as the service makes them.

    Once a change is found no window reaches back beyond it. Nothing is said of fewer than five
    people who walk.

    Raises:
        Exception: what a part failed with that the service would have done without.
    """
    every = observe(tracks, site.intrinsics, site.prior)
    ended_s = every.ended_s
    from_s = -np.inf
    step = window.batch or max(len(tracks), 1)
    for came in [*range(step, len(tracks), step), len(tracks)]:
        if not came:
            return
        oldest_s = max(from_s, float(ended_s[came - 1]) - window.days * DAY_S)
        since = int(np.searchsorted(ended_s[:came], oldest_s, side="left"))
        first = max(since, came - window.tracks)
        seen = of_tracks(every, np.arange(first, came))
        if seen.walkers < FEWEST_WALKERS:
            continue
        found = served_pose(seen, site)
        cut = None if found.change_idx is None else first + found.change_idx
        if cut is not None:
            from_s = float(ended_s[cut])
        yield Look(tracks=came, first=first, seen=seen, finding=found, cut=cut)
