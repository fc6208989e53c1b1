"""People who walk together: how many independent walking groups there are among the tracks.

Ours: two tracks are one group where they are within 4 m and 37 deg of one another for 60 % of the
shorter; groups are the connected components of such pairs.
"""

from collections import Counter
from itertools import combinations

import numpy as np
import numpy.typing as npt

from models.estimation.joint.measures import Measured
from models.geometry.rotation import Array

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
    together: Counter[tuple[int, int]] = Counter()
    lengths = Counter(owner_idx.tolist())
    firsts = np.flatnonzero(np.diff(bins, prepend=np.nan))
    for rows in np.split(np.arange(bins.size), firsts[1:]):
        for i, j in combinations(rows, 2):
            near = np.hypot(*(positions[i] - positions[j])) < _NEAR_M
            if near and ways[i] @ ways[j] > _SAME_WAY:
                together[(owner_idx[i], owner_idx[j])] += 1
    beside = [
        pair
        for pair, count in together.items()
        if count >= _SHARE * min(lengths[pair[0]], lengths[pair[1]])
    ]
    return first_joined(np.array(beside, dtype=np.int64).reshape(-1, 2), owners)


def first_joined(pairs: npt.NDArray[np.int64], owners: int) -> npt.NDArray[np.int64]:
    """The first track (owners,) of all that pairs (K, 2) join each to."""
    from scipy.sparse import coo_array  # late: the HTTP process has no use for it
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(owners, owners))
    _, group_idx = connected_components(links, directed=False)
    _, firsts = np.unique(group_idx, return_index=True)
    return np.asarray(firsts[group_idx])


def _sampled(
    time_s: Array, owner_idx: npt.NDArray[np.int64], place: Array, way: Array
) -> tuple[Array, Array, Array, npt.NDArray[np.int64]]:
    """One step for each track and time bin: bins (K,), places, directions (K, 2), owners."""
    since_s = time_s - time_s.min(initial=np.inf)
    time_bin = np.floor(since_s / _BIN_S + 1e-3)
    _, first = np.unique(np.stack([time_bin, owner_idx]), axis=1, return_index=True)
    return time_bin[first], place[first], way[first], owner_idx[first]
