"""Which points of tracks are at their ends: a loop over all tracks."""

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array

_FURTHER = 2.2  # times the usual interval between points: two of a sparse track at least


@compiled
def points_at_ends(
    time_s: Array, bounds: npt.NDArray[np.int64], last: bool, span_s: float, most: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Some points (K,) within a time of an end of each track, in time order, and the tracks (K,).

    The end's own point is among them.

    Args:
        time_s: of all points (T,).
        bounds: of the N tracks (N + 1,).
        last: whether the last ends are asked for, or the first.
        span_s: how far from the end, farther where points are sparse.
        most: points of an end.
    """
    chosen = np.empty(most * (bounds.size - 1), dtype=np.int64)
    owner = np.empty(chosen.size, dtype=np.int64)
    found = 0
    for track in range(bounds.size - 1):
        first, final = bounds[track], bounds[track + 1] - 1
        usual_s = (time_s[final] - time_s[first]) / max(final - first, 1)
        reach_s = max(span_s, _FURTHER * usual_s)
        low, high = first, final
        if last:
            low = final
            while low > first and time_s[low - 1] >= time_s[final] - reach_s:
                low -= 1
        else:
            high = first
            while high < final and time_s[high + 1] <= time_s[first] + reach_s:
                high += 1
        stride = -(-(high - low + 1) // most)
        number = (high - low) // stride + 1
        begin = high - (number - 1) * stride if last else low
        for place in range(number):
            chosen[found], owner[found] = begin + place * stride, track
            found += 1
    return chosen[:found], owner[:found]
