"""Feet that jump: the lower edge of a box springs up and back, and nobody walks like that."""

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array, Mask

_FEWEST = 10  # points of a track: two jumps are less than a quarter of its changes
_AROUND = 2  # changes on either side of one that say what is usual there
_QUARTER = 0.25
_BEYOND = 5.0  # times what a quarter of a track's changes are beyond: 5.8 sd of a Gaussian
_LEAST = 0.01  # of the picture: 0.3 m of a person who takes 6 % of it
_LONGEST_S = 6.0  # in the air
_ALIKE = 2.0  # times as far down as up, or up as down


@compiled
def jumped(time_s: Array, uv: Array, bounds: npt.NDArray[np.int64], image_height: float) -> Mask:
    """Which points (T,) are between a jump up the picture and one down that is about as large.

    A jump is a change from one point to the next that is unlike those around it, by far more than
    such changes are in the same track. What jumps once, or the other way, is of another kind.

    Args:
        time_s: of all points (T,).
        uv: feet (T, 2) in pixels.
        bounds: of the N tracks (N + 1,).
        image_height: in pixels.
    """
    found = np.zeros(time_s.size, dtype=np.bool_)
    for track in range(bounds.size - 1):
        first, beyond = bounds[track], bounds[track + 1]
        if beyond - first < _FEWEST:
            continue
        seconds = np.diff(time_s[first:beyond])
        rate = np.diff(uv[first:beyond, 1].copy()) / seconds
        change, count = np.empty(rate.size), rate.size
        around = np.empty(2 * _AROUND + 1)
        for j in range(count):
            begin = min(max(j - _AROUND, 0), count - around.size)
            for k in range(around.size):
                around[k] = rate[begin + k]
            around.sort()
            change[j] = (rate[j] - around[_AROUND]) * seconds[j]
        ranked = np.sort(np.abs(change))
        limit = max(_BEYOND * ranked[int((1 - _QUARTER) * count)], _LEAST * image_height)
        up = -1
        for j in range(count):
            if change[j] < -limit:
                up = j
            elif change[j] > limit:
                if up >= 0 and time_s[first + j] - time_s[first + up + 1] <= _LONGEST_S:
                    share = -change[j] / change[up]
                    if 1 / _ALIKE <= share <= _ALIKE:
                        found[first + up + 1 : first + j + 1] = True
                up = -1
    return found
