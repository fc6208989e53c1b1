"""People who walk together: how many independent parties there are among the tracks."""

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
_SHARE = 0.6  # of the shorter walk that two people spend side by side to be one party


def count_parties(speeds: Measured) -> int:
    """Parties of people who walk side by side the same way; someone alone is one.

    People of one party share their pace and their pauses: twenty of them tell hardly more than one.
    """
    bins, positions, ways, owners = _sampled(speeds)
    together: Counter[tuple[int, int]] = Counter()
    lengths = Counter(owners.tolist())
    firsts = np.flatnonzero(np.diff(bins, prepend=np.nan))
    for rows in np.split(np.arange(bins.size), firsts[1:]):
        for i, j in combinations(rows, 2):
            near = np.hypot(*(positions[i] - positions[j])) < _NEAR_M
            if near and ways[i] @ ways[j] > _SAME_WAY:
                together[(owners[i], owners[j])] += 1
    parties = {owner: {owner} for owner in lengths}
    for (one, other), count in together.items():
        if (
            count >= _SHARE * min(lengths[one], lengths[other])
            and parties[one] is not parties[other]
        ):
            joined = parties[one] | parties[other]
            for owner in joined:
                parties[owner] = joined
    return len({id(party) for party in parties.values()})


def _sampled(speeds: Measured) -> tuple[Array, Array, Array, npt.NDArray[np.int64]]:
    """One moving row for each track and time bin: bins (K,), places, directions (K, 2), owners."""
    assert speeds.direction is not None
    moving = np.flatnonzero(speeds.valid & (speeds.value > np.log(_STANDING_MPS)))
    owner = speeds.rows.owner_idx[moving]
    since_s = speeds.rows.time_s[moving] - speeds.rows.time_s.min(initial=np.inf)
    time_bin = np.floor(since_s / _BIN_S + 1e-3)
    _, first = np.unique(np.stack([time_bin, owner]), axis=1, return_index=True)
    chosen = moving[first]
    return time_bin[first], speeds.place[chosen], speeds.direction[chosen], owner[first]
