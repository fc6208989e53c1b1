"""Runs of points without a gap, nodes along them, smoothed by local straight lines, and steps.

The points of N tracks stand one track after the other: track n has those from `bounds[n]` on, up to
`bounds[n + 1]`. Source of the smoothing: Cleveland 1979.
"""

import math

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Index, Mask
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks import config

_LEAST_TOTAL, _LEAST_VARIANCE = 1e-12, 1e-9


@compiled
def runs_of_tracks(time_s: Array, inside: Mask, bounds: Index) -> Index:
    """Runs (R, 3) of points inside the image without a gap: the track, the first, one beyond.

    `inside` (T,) says which points are in the image.
    """
    found = []
    for track in range(bounds.size - 1):
        first, beyond = bounds[track], bounds[track + 1]
        gap_s = config.LONGEST_GAP_S
        if beyond - first > 1:
            usual_s = float(np.median(time_s[first + 1 : beyond] - time_s[first : beyond - 1]))
            gap_s = max(config.USUAL_GAPS * usual_s, config.LONGEST_GAP_S)
            gap_s = min(gap_s, config.SPARSEST_GAP_S)
        begin = first
        for j in range(first + 1, beyond + 1):
            if j < beyond and inside[j] and inside[j - 1] and time_s[j] - time_s[j - 1] <= gap_s:
                continue
            if j - begin >= config.RUN_POINTS and inside[begin]:
                found.append((track, begin, j))
            begin = j
    runs = np.empty((len(found), 3), dtype=np.int64)
    for number, (track, begin, beyond) in enumerate(found):
        runs[number, 0], runs[number, 1], runs[number, 2] = track, begin, beyond
    return runs


@compiled
def nodes_of_runs(
    time_s: Array, uv: Array, top_v: Array, runs: Index
) -> tuple[Index, Array, Array, Array]:
    """The first node of each run (R + 1,), nodes' times (K,), smooth feet (K, 2) and tops (K,).

    A run that is shorter than a step has no nodes, and a track no more than `MOST_NODES`: of the
    run that would pass it the middle, of later ones none. A top is NaN where none is known.

    The smoothing is wider where points are sparse; `runs` are those of `runs_of_tracks`.
    """
    step_s = config.STEP_S
    firsts = np.zeros(len(runs) + 1, dtype=np.int64)
    left = config.MOST_NODES
    for number in range(len(runs)):
        begin, last = runs[number, 1], runs[number, 2] - 1
        if number and runs[number, 0] != runs[number - 1, 0]:
            left = config.MOST_NODES
        count = min(int((time_s[last] - time_s[begin]) / step_s + 1e-6) + 1, left)
        count = count if count > 1 else 0
        firsts[number + 1] = firsts[number] + count
        left -= count
    nodes_s, feet = np.empty(firsts[-1]), np.empty((firsts[-1], 2))
    across, along = uv[:, 0].copy(), uv[:, 1].copy()  # one kind of array for the lines
    tops, tall = np.full(firsts[-1], np.nan), along - top_v
    for number in range(len(runs)):
        begin, beyond = runs[number, 1], runs[number, 2]
        first, count = firsts[number], firsts[number + 1] - firsts[number] - 1
        if count < 1:
            continue
        duration_s = time_s[beyond - 1] - time_s[begin]
        reach_s = max(
            config.KERNEL_S,
            1.01 * float(np.median(time_s[begin + 1 : beyond] - time_s[begin : beyond - 1])),
        )
        boxed = 0
        for j in range(begin, beyond):
            boxed += np.isfinite(tall[j])
        near = begin
        for node in range(first, first + count + 1):
            at_s = time_s[begin] + (duration_s - count * step_s) / 2 + (node - first) * step_s
            nodes_s[node] = at_s
            while near < beyond and time_s[near] <= at_s - reach_s:
                near += 1
            lined, u = _line(time_s, across, near, beyond, at_s, reach_s)
            _, v = _line(time_s, along, near, beyond, at_s, reach_s)
            if not lined:
                before = max(near - 1, begin)
                u = _between(time_s, across, before, beyond, at_s)
                v = _between(time_s, along, before, beyond, at_s)
            feet[node, 0], feet[node, 1] = u, v
            if boxed >= config.LINE_POINTS:
                # The box's height is smoothed, not its top: it is the same all through a stride.
                known, height = _line(time_s, tall, near, beyond, at_s, reach_s)
                if known:
                    tops[node] = v - height
    return firsts, nodes_s, feet, tops


@compiled
def _line(
    time_s: Array, values: Array, first: int, beyond: int, at_s: float, reach_s: float
) -> tuple[bool, float]:
    """True if two known points are within reach, and the value of a weighted line through all."""
    number, total, centre, mean = 0, 0.0, 0.0, 0.0
    for j in range(first, beyond):
        ahead = time_s[j] - at_s
        if ahead >= reach_s:
            break
        weight = 1 - abs(ahead) / reach_s
        if weight > 0 and np.isfinite(values[j]):
            number += 1
            total += weight
            centre += weight * ahead
            mean += weight * values[j]
    total = max(total, _LEAST_TOTAL)
    centre, mean = centre / total, mean / total
    variance, slope = 0.0, 0.0
    for j in range(first, beyond):
        ahead = time_s[j] - at_s
        if ahead >= reach_s:
            break
        weight = 1 - abs(ahead) / reach_s
        if weight > 0 and np.isfinite(values[j]):
            variance += weight * (ahead - centre) ** 2
            slope += weight * (ahead - centre) * values[j]
    slope = slope / total / max(variance / total, _LEAST_VARIANCE)
    return number >= config.LINE_POINTS, mean - slope * centre


@compiled
def _between(time_s: Array, values: Array, first: int, beyond: int, at_s: float) -> float:
    """The value on the straight line between the points before and after a time."""
    after = first + 1
    while after < beyond - 1 and time_s[after] < at_s:
        after += 1
    share = (at_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1])
    value: float = values[after - 1] + min(max(share, 0.0), 1.0) * (
        values[after] - values[after - 1]
    )
    return value


_LEAST_CHORD = 1e-7  # of a ray: far less than a pixel
_OF_BEND = SD_OF_MEDIAN_DEVIATION / math.sqrt(6.0)


@compiled
def steps_of_runs(rays: Array, firsts: Index) -> tuple[Array, Array, Array]:
    """Rays to both ends of steps, and to the ends that noise may make of them: (K, 3) each.

    A step is from each node to the next of its run, in that node's place; those of the last nodes
    of runs are nothing.
    """
    starts, ends, noisy_ends = np.zeros(rays.shape), np.zeros(rays.shape), np.zeros(rays.shape)
    for run in range(firsts.size - 1):
        first, last = firsts[run], firsts[run + 1] - 1
        if last <= first:
            continue
        way, lever = _ways(rays[first : last + 1])
        noise = _noise(rays[first : last + 1], way)
        for step in range(last - first):
            node = first + step
            x, y = way[step, 0], way[step, 1]
            across_x = rays[node + 1, 0] - rays[node, 0]
            across_y = rays[node + 1, 1] - rays[node, 1]
            half = max(abs(across_x * x + across_y * y), _LEAST_CHORD) / 2
            middle_x = (rays[node + 1, 0] + rays[node, 0]) / 2
            middle_y = (rays[node + 1, 1] + rays[node, 1]) / 2
            turn = min(noise / lever[step], config.MOST_DIRECTION_NOISE)
            starts[node, 0], starts[node, 1] = middle_x - half * x, middle_y - half * y
            ends[node, 0], ends[node, 1] = middle_x + half * x, middle_y + half * y
            noisy_ends[node, 0] = middle_x + half * (x - turn * y)
            noisy_ends[node, 1] = middle_y + half * (y + turn * x)
            starts[node, 2] = ends[node, 2] = noisy_ends[node, 2] = 1.0
    return starts, ends, noisy_ends


@compiled
def _ways(rays: Array) -> tuple[Array, Array]:
    """Directions (K - 1, 2) of the steps: of straight lines through the nodes around each.

    A node's noise over the lever (K - 1,) is the direction's, in radians.
    """
    way, lever = np.empty((len(rays) - 1, 2)), np.empty(len(rays) - 1)
    for step in range(len(rays) - 1):
        low = max(step + 1 - config.DIRECTION_NODES, 0)
        high = min(step + config.DIRECTION_NODES, len(rays) - 1)
        middle = (low + high) / 2
        moment, slope_x, slope_y = 0.0, 0.0, 0.0
        for node in range(low, high + 1):
            ahead = node - middle
            moment += ahead * ahead
            slope_x += ahead * rays[node, 0]
            slope_y += ahead * rays[node, 1]
        slope_x, slope_y = slope_x / moment, slope_y / moment
        length = max(math.sqrt(slope_x * slope_x + slope_y * slope_y), _LEAST_CHORD)
        way[step, 0], way[step, 1] = slope_x / length, slope_y / length
        lever[step] = length * math.sqrt(moment)
    return way, lever


@compiled
def _noise(rays: Array, way: Array) -> float:
    """Standard deviation of a node of a run, sideways, by differences (Gasser et al. 1986)."""
    if len(rays) < 3:
        return 0.0  # two nodes make one step, and one step has no track to differ from
    bend = np.empty(len(rays) - 2)
    for node in range(bend.size):
        bent_x = rays[node + 2, 0] - 2 * rays[node + 1, 0] + rays[node, 0]
        bent_y = rays[node + 2, 1] - 2 * rays[node + 1, 1] + rays[node, 1]
        bend[node] = abs(bent_y * way[node + 1, 0] - bent_x * way[node + 1, 1])
    return _OF_BEND * float(np.median(bend))
