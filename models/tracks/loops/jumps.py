"""Feet that jump: the lower edge of a box springs up and back, and nobody walks like that."""

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array, Mask
from models.tracks import config


@compiled
def jumped(time_s: Array, uv: Array, bounds: npt.NDArray[np.int64], image_height: float) -> Mask:
    """A mask (T,) of points above the feet: between a jump up the picture and one back down.

    A jump is a change from one point to the next that is unlike those around it, by far more than
    such changes are in the same track. The one down is about as large as the one up, six seconds
    later at most. A walk that began in the air has its first jump down, within six seconds and
    before its middle; one that ended there has its last jump up.
    """
    found = np.zeros(time_s.size, dtype=np.bool_)
    for track in range(bounds.size - 1):
        first, beyond = bounds[track], bounds[track + 1]
        if beyond - first < config.JUMP_FEWEST:
            continue
        # Differences by slices: np.diff takes a second to compile, here as elsewhere.
        seconds = time_s[first + 1 : beyond] - time_s[first : beyond - 1]
        rate = (uv[first + 1 : beyond, 1] - uv[first : beyond - 1, 1]) / seconds
        change, count = np.empty(rate.size), rate.size
        least, largest = config.JUMP_LEAST * image_height, 0.0
        for j in range(count):
            begin = min(max(j - config.JUMP_AROUND, 0), count - 2 * config.JUMP_AROUND - 1)
            change[j] = (rate[j] - _middle_of_five(rate, begin)) * seconds[j]
            largest = max(largest, abs(change[j]))
        if largest <= least:  # nearly all tracks: they are spared the sorting
            continue
        ranked = np.sort(np.abs(change))
        limit = max(config.JUMP_BEYOND * ranked[int((1 - config.JUMP_SHARE) * count)], least)
        up, first_is_next = -1, True
        for j in range(count):
            if change[j] < -limit:
                up, first_is_next = j, False
            elif change[j] > limit:
                fewer = first_is_next and 2 * (j + 1) < beyond - first
                if fewer and time_s[first + j] - time_s[first] <= config.JUMP_LONGEST_S:
                    found[first : first + j + 1] = True
                if up >= 0 and time_s[first + j] - time_s[first + up + 1] <= config.JUMP_LONGEST_S:
                    share = -change[j] / change[up]
                    if 1 / config.JUMP_ALIKE <= share <= config.JUMP_ALIKE:
                        found[first + up + 1 : first + j + 1] = True
                up, first_is_next = -1, False
        ending = first + up + 1
        fewer = up >= 0 and 2 * (beyond - ending) < beyond - first
        if fewer and time_s[beyond - 1] - time_s[ending] <= config.JUMP_LONGEST_S:
            found[ending:beyond] = True
    return found


@compiled
def _middle_of_five(values: Array, first: int) -> float:
    """The median of five values from a place on, without a list of them."""
    a, b, c = values[first], values[first + 1], values[first + 2]
    d, e = values[first + 3], values[first + 4]
    low = max(min(a, b), min(c, d))
    high = min(max(a, b), max(c, d))
    middle: float = max(min(low, high), min(max(low, high), e))
    return middle
