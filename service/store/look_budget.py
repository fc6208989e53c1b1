"""What one look at a camera may read: of more, the largest tracks count and are not looked at.

CPU and memory of a look grow with the rows that are made of its tracks, one for each node and
another for its box or head, and with their points, which is known before any is read: 25,000 rows
are up to 35 CPU-s of an estimate, 4 of a map, and 60 MB.
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


class LookBudget:
    """The budget of one look, or a `share` of it; `skipped` are the names of tracks by number.

    Each reading of tracks may spend all of it.
    """

    def __init__(self, share: float = 1.0) -> None:
        self.share = share
        self.skipped: dict[int, str] = {}

    def leave_out(self, sizes: Sequence[TrackSize]) -> list[int]:
        """The fewest tracks to be left out, the largest first, for the others to be in budget."""
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
