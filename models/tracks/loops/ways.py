"""Steps between the nodes of runs, each laid along the line through the nodes around it."""

import math

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks.config import DIRECTION_NODES, MOST_DIRECTION_NOISE

_LEAST_CHORD = 1e-7  # of a ray: far less than a pixel
_OF_BEND = SD_OF_MEDIAN_DEVIATION / math.sqrt(6.0)


@compiled
def steps_of_runs(rays: Array, firsts: npt.NDArray[np.int64]) -> tuple[Array, Array, Array]:
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
            turn = min(noise / lever[step], MOST_DIRECTION_NOISE)
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
        low = max(step + 1 - DIRECTION_NODES, 0)
        high = min(step + DIRECTION_NODES, len(rays) - 1)
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
