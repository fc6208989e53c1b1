"""Points of tracks that are no feet: of boxes that are too short, and where the lower edge jumps.

Whatever hides somebody's feet leaves the upper edge of the box where it is. Of a plane seen by a
camera in any pose, how tall one person looks is a linear function of where their head is in the
picture: so each track is compared with itself, and a camera that has moved changes nothing. The
line is a quantile's, above the middle: what is hidden is below it.

Source of the line: Koenker and Bassett 1978; of how it is found: Hunter and Lange 2000.
"""

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Index, Mask
from models.tracks import config

_SD_OF_MEDIAN_CHANGE = 1.4826 / np.sqrt(2)  # a change is of two boxes


@compiled
def short_boxes(uv: Array, top_v: Array, bounds: Index) -> Mask:
    """A mask (T,) of points whose box is too short: what it ends at are no feet.

    None of a track with fewer than eight boxes; somebody hidden all along the way looks like a
    small person, and is taken for one.
    """
    short = np.zeros(top_v.size, dtype=np.bool_)
    for track in range(bounds.size - 1):
        first, beyond = bounds[track], bounds[track + 1]
        boxed = np.empty(beyond - first, dtype=np.int64)
        number = 0
        for j in range(first, beyond):
            if uv[j, 1] > top_v[j]:  # NaN is not
                boxed[number] = j
                number += 1
        if number < config.HIDDEN_FEWEST:
            continue
        boxed = boxed[:number]
        tall, across, down = np.empty(number), np.empty(number), np.empty(number)
        for k in range(number):
            tall[k] = uv[boxed[k], 1] - top_v[boxed[k]]
        middle = float(np.median(tall))
        for k in range(number):
            tall[k] /= middle
            across[k] = (uv[boxed[k], 0] - uv[boxed[0], 0]) / middle
            down[k] = (top_v[boxed[k]] - top_v[boxed[0]]) / middle
        off = _off_the_line(tall, across, down)
        changes = np.abs(off[1:] - off[:-1])
        limit = max(
            config.HIDDEN_LOG, config.HIDDEN_SDS * _SD_OF_MEDIAN_CHANGE * float(np.median(changes))
        )
        for k in range(number):
            short[boxed[k]] = off[k] < -limit
    return short


@compiled
def _off_the_line(tall: Array, across: Array, down: Array) -> Array:
    """Logs (K,) of heights (K,) over a line in two coordinates (K,), (K,), a quantile of them."""
    stride = -(-tall.size // config.HIDDEN_MOST)
    some_tall, some_across, some_down = tall[::stride], across[::stride], down[::stride]
    mean_across, mean_down = float(np.mean(some_across)), float(np.mean(some_down))
    level, by_across, by_down = float(np.median(some_tall)), 0.0, 0.0
    for _ in range(config.HIDDEN_ROUNDS):
        # Weighted sums of products: of 1, the two coordinates, the height.
        s, sa, sd, st = 0.0, 0.0, 0.0, 0.0
        saa, sad, sdd, sat, sdt = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(some_tall.size):
            a, d, t = some_across[k] - mean_across, some_down[k] - mean_down, some_tall[k]
            line = max(level + by_across * a + by_down * d, config.HIDDEN_LEAST_LINE)
            over = t / line - 1
            weight = (config.HIDDEN_QUANTILE if over > 0 else 1 - config.HIDDEN_QUANTILE) / max(
                abs(over), config.HIDDEN_NEAREST
            )
            s += weight
            sa += weight * a
            sd += weight * d
            st += weight * t
            saa += weight * a * a
            sad += weight * a * d
            sdd += weight * d * d
            sat += weight * a * t
            sdt += weight * d * t
        # About the weighted means two equations are left.
        aa, ad = saa - sa * sa / s + config.HIDDEN_HOLD * s, sad - sa * sd / s
        dd = sdd - sd * sd / s + config.HIDDEN_HOLD * s
        at, dt = sat - sa * st / s, sdt - sd * st / s
        determinant = aa * dd - ad * ad
        by_across = (at * dd - dt * ad) / determinant
        by_down = (dt * aa - at * ad) / determinant
        level = (st - by_across * sa - by_down * sd) / s
    off = np.empty(tall.size)
    for k in range(tall.size):
        line = level + by_across * (across[k] - mean_across) + by_down * (down[k] - mean_down)
        off[k] = np.log(tall[k] / max(line, config.HIDDEN_LEAST_LINE))
    return off


@compiled
def jumped(time_s: Array, uv: Array, bounds: Index, image_height: float) -> Mask:
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
