"""People who walk together: how many independent walking groups there are among the tracks.

Ours: two tracks are one group where they are within 4 m and 37 deg of one another for 60 % of the
shorter; groups are the connected components of such pairs.
"""

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Index
from models.tracks.linking import first_of_component
from models.walking import config
from models.walking.measures import Measured


def count_walking_groups(speeds: Measured) -> int:
    """Walking groups: people who walk side by side the same way; someone alone is one.

    People of one walking group share their pace and their pauses: twenty of them tell hardly more
    than one.
    """
    assert speeds.direction is not None
    walking = np.flatnonzero(speeds.valid & (speeds.value > np.log(config.GROUP_STANDING_MPS)))
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
    time_s: Array, owner_idx: Index, place: Array, direction: Array, owners: int
) -> Index:
    """The group (owners,) of each track, by its walked steps (M,): one of its tracks stands for it.

    Args:
        time_s: when each step was (M,).
        owner_idx: the track of each (M,).
        place: where it was on the ground (M, 2), metres.
        direction: unit vectors (M, 2) of where it went.
        owners: how many tracks there are; those without steps are each a walking group.
    """
    since_s = time_s - time_s.min(initial=np.inf)
    time_bin = np.floor(since_s / config.GROUP_BIN_S + 1e-3).astype(np.int64)
    order = np.lexsort((owner_idx, time_bin))
    fresh = (np.diff(time_bin[order], prepend=-1) != 0) | (
        np.diff(owner_idx[order], prepend=-1) != 0
    )
    first = order[fresh]  # one step for each track and bin
    together = pairs_beside(time_bin[first], owner_idx[first], place[first], direction[first])
    pair, count = np.unique(together[:, 0] * owners + together[:, 1], return_counts=True)
    beside = np.stack(np.divmod(pair, owners), axis=1)
    lengths = np.bincount(owner_idx[first], minlength=owners)
    return first_of_component(
        beside[count >= config.GROUP_SHARE * lengths[beside].min(axis=1)], owners
    )


@compiled
def pairs_beside(
    time_bin: Index,
    owner_idx: Index,
    place: Array,
    direction: Array,
) -> Index:
    """Pairs of tracks (K, 2), one for each time that the two are beside one another.

    Bins of time are ascending (M,), and so are tracks (M,) within a bin.
    """
    found = []
    for i in range(time_bin.size):
        j = i + 1
        while j < time_bin.size and time_bin[j] == time_bin[i]:
            apart = np.hypot(place[i, 0] - place[j, 0], place[i, 1] - place[j, 1])
            same = direction[i, 0] * direction[j, 0] + direction[i, 1] * direction[j, 1]
            if apart < config.GROUP_NEAR_M and same > config.GROUP_SAME_WAY:
                found.append((owner_idx[i], owner_idx[j]))
            j += 1
    pairs = np.empty((len(found), 2), dtype=np.int64)
    for k, (first, second) in enumerate(found):
        pairs[k, 0], pairs[k, 1] = first, second
    return pairs
