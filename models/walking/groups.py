"""People who walk together: how many independent walking groups there are among the tracks.

Ours: two tracks are one group where they are within 4 m and 37 deg of one another for 60 % of the
shorter; groups are the connected components of such pairs.
"""

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array
from models.tracks.components import first_of_component
from models.walking.loops.pairs import pairs_beside
from models.walking.measures import Measured

_BIN_S = 3.0
_NEAR_M = 4.0
_SAME_WAY = 0.8  # cosine: 37 deg
_STANDING_MPS = 0.4
_SHARE = 0.6  # of the shorter walk that two people spend side by side to be one walking group


def count_walking_groups(speeds: Measured) -> int:
    """Walking groups: people who walk side by side the same way; someone alone is one.

    People of one walking group share their pace and their pauses: twenty of them tell hardly more
    than one.
    """
    assert speeds.direction is not None
    walking = np.flatnonzero(speeds.valid & (speeds.value > np.log(_STANDING_MPS)))
    rows = speeds.rows
    labels = walking_groups_of(
        rows.time_s[walking],
        rows.owner_idx[walking],
        speeds.place[walking],
        speeds.direction[walking],
        rows.owners,
    )
    return int(np.unique(labels[np.unique(rows.owner_idx[walking])]).size)


def walking_groups_of(
    time_s: Array, owner_idx: npt.NDArray[np.int64], place: Array, way: Array, owners: int
) -> npt.NDArray[np.int64]:
    """The group (owners,) of each track, by its walked steps (M,): one of its tracks stands for it.

    Args:
        time_s: when each step was (M,).
        owner_idx: the track of each (M,).
        place: where it was on the ground (M, 2), metres.
        way: unit vectors (M, 2) of where it went.
        owners: how many tracks there are; those without steps are each a walking group.
    """
    bins, positions, ways, owner_idx = _sampled(time_s, owner_idx, place, way)
    together = pairs_beside(bins, owner_idx, positions, ways, _NEAR_M, _SAME_WAY)
    pair, count = np.unique(together[:, 0] * owners + together[:, 1], return_counts=True)
    beside = np.stack(np.divmod(pair, owners), axis=1)
    lengths = np.bincount(owner_idx, minlength=owners)
    return first_of_component(beside[count >= _SHARE * lengths[beside].min(axis=1)], owners)


def _sampled(
    time_s: Array, owner_idx: npt.NDArray[np.int64], place: Array, way: Array
) -> tuple[npt.NDArray[np.int64], Array, Array, npt.NDArray[np.int64]]:
    """One step for each track and time bin: bins (K,), places, directions (K, 2), owners."""
    since_s = time_s - time_s.min(initial=np.inf)
    time_bin = np.floor(since_s / _BIN_S + 1e-3).astype(np.int64)
    order = np.lexsort((owner_idx, time_bin))
    fresh = (np.diff(time_bin[order], prepend=-1) != 0) | (
        np.diff(owner_idx[order], prepend=-1) != 0
    )
    first = order[fresh]
    return time_bin[first], place[first], way[first], owner_idx[first]
