"""Pairs of people who are beside one another at the same time."""

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array


@compiled
def pairs_beside(
    time_bin: npt.NDArray[np.int64],
    owner_idx: npt.NDArray[np.int64],
    place: Array,
    way: Array,
    near_m: float,
    same_way: float,
) -> npt.NDArray[np.int64]:
    """Pairs of tracks (K, 2), one for each time that the two are beside one another.

    Args:
        time_bin: ascending (M,).
        owner_idx: tracks (M,), ascending within a bin.
        place: where each was (M, 2), metres.
        way: unit vectors (M, 2) of where it went.
        near_m: how near is beside.
        same_way: the least cosine between two ways.
    """
    found = []
    for i in range(time_bin.size):
        j = i + 1
        while j < time_bin.size and time_bin[j] == time_bin[i]:
            apart = np.hypot(place[i, 0] - place[j, 0], place[i, 1] - place[j, 1])
            same = way[i, 0] * way[j, 0] + way[i, 1] * way[j, 1]
            if apart < near_m and same > same_way:
                found.append((owner_idx[i], owner_idx[j]))
            j += 1
    pairs = np.empty((len(found), 2), dtype=np.int64)
    for k, (first, second) in enumerate(found):
        pairs[k, 0], pairs[k, 1] = first, second
    return pairs
