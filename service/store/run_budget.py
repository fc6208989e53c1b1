"""The budget of an estimation run; if the tracks exceed it, the largest ones are skipped.

CPU time and memory of a run grow with the number of points and of rows: one row for each node of a
track, and another for its box or head. Both numbers are known before a track is read. 25,000 rows
take up to 35 CPU seconds for an estimate, 4 for a map, and 60 MB.
"""

from collections.abc import Sequence
from typing import NamedTuple

from models.tracks.trajectory import most_nodes

_MOST_ROWS = 25_000  # recorded windows of 400 tracks have 18,400 at most
MAP_BUDGETS = 3.0  # of a map's growth: recorded are 61,000 rows of 2,000 tracks
_POINT_BYTES = 24  # of which a track with neither boxes nor heads is
_MOST_BYTES = 96e6  # of points, boxes and heads: of 2,000 people 35 s at 25 Hz, with boxes


class TrackSize(NamedTuple):
    """The size of a stored track."""

    id: int
    track_id: str
    duration_s: float
    points: int
    stored_bytes: int


class RunBudget:
    """The budget of a run, or a `share` of it; `skipped` has the ids of skipped tracks by number.

    Each query of tracks may use all of it.
    """

    def __init__(self, share: float = 1.0) -> None:
        self.share = share
        self.skipped: dict[int, str] = {}

    def leave_out(self, sizes: Sequence[TrackSize]) -> list[int]:
        """The fewest tracks to skip, largest first, so that the others fit the budget."""
        costs = [(_cost(size), size) for size in sizes]
        total = sum(cost for cost, _ in costs)
        found: list[int] = []
        for cost, size in sorted(costs, key=lambda pair: (-pair[0], pair[1].id)):
            if total <= self.share:
                break
            total -= cost
            found.append(size.id)
            self.skipped[size.id] = size.track_id
        return found


def _cost(size: TrackSize) -> float:
    """The share of a budget that a track takes."""
    rows = most_nodes(size.points, size.duration_s)
    if size.stored_bytes > _POINT_BYTES * size.points:
        rows *= 2
    return max(rows / _MOST_ROWS, size.stored_bytes / _MOST_BYTES)
