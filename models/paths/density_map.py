"""The path density map: how often people are where, and which way they walk, on a grid.

Log densities are rounded to 1/64, so that they are the same offline as they are stored.

Source: Silverman 1982, a kernel density by binning; von Mises kernels over directions are Hall,
Watson and Cabrera's, 1987.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.durations import DAY_S
from models.geometry.rotation import Array
from models.paths import config
from models.paths.density_grid import Grid, log_densities_at, unseen_at_places
from models.paths.ground_steps import Placement


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidths:
    """Of a map: the Gaussian's over places, the von Mises kernel's over directions, the day's.

    `slots` is the number of equal parts of the day.
    """

    place_m: float
    direction_kappa: float
    slots: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PathDensityMap:
    """A log density (S, X, Y, 16) over place (1/m^2) and direction (1/rad) at grid nodes.

    Nodes stand `cell_m` apart from `corner` (2,) on; directions from +X on, evenly; S equal parts
    of the day from midnight UTC on, or one. `elsewhere` is the log density off the grid. `unseen`
    (X, Y) is how much of each node's ground the reference did not see. Were people as many there as
    on the seen ground, `log_level` would be their mean log density and `log_typical` that of a
    person: they heap on paths there, too. `people` (X, Y) is how
    many people's steps made a node: how sure it is.
    """

    corner: Array
    cell_m: float
    log_density: Array
    elsewhere: float
    unseen: Array
    log_level: float
    log_typical: float
    people: Array

    @property
    def slots(self) -> int:
        """The number of parts of the day."""
        return int(self.log_density.shape[0])

    def slot_of(self, time_s: Array) -> npt.NDArray[np.int64]:
        """The part of the day of each time (M,)."""
        return slot_of(time_s, self.slots)

    @property
    def grid(self) -> Grid:
        """The nodes as compiled loops read them."""
        return Grid(
            log_density=np.ascontiguousarray(self.log_density, dtype=np.float64),
            unseen=np.ascontiguousarray(self.unseen, dtype=np.float64),
            corner=np.ascontiguousarray(self.corner, dtype=np.float64),
            nodes_per_m=1 / float(self.cell_m),
            elsewhere=float(self.elsewhere),
        )

    def log_density_at(
        self, place: Array, direction: Array, slot_idx: npt.NDArray[np.int64]
    ) -> tuple[Array, Array, Array]:
        """Log densities (M,) and their derivatives by place (M, 2) and direction (M,)."""
        return log_densities_at(
            self.grid,
            np.ascontiguousarray(place),
            np.ascontiguousarray(direction),
            np.ascontiguousarray(slot_idx),
        )

    def unseen_at(self, place: Array) -> tuple[Array, Array]:
        """The part (M,) of the ground at places that was not seen, and its slopes (M, 2).

        Outside of the grid both are 0.
        """
        return unseen_at_places(self.grid, np.ascontiguousarray(place))


def slot_of(time_s: Array, slots: int) -> npt.NDArray[np.int64]:
    """The one of so many equal parts of a UTC day that each time (M,) is in."""
    if slots == 1:
        return np.zeros(time_s.shape, dtype=np.int64)
    return np.floor(time_s % DAY_S / DAY_S * slots).astype(np.int64) % slots


def learn_map(
    placed: Placement,
    weight: Array,
    time_s: Array,
    seen_at: Callable[[Array], Array],
    bandwidths: Bandwidths,
) -> PathDensityMap:
    """The map of steps seen from a known pose, each counted by its weight (M,).

    Args:
        placed: the steps on the ground.
        weight: those of a person add up to how much that person counts.
        time_s: when each step was (M,).
        seen_at: which part (N,) of the ground around places (N, 2) that pose sees.
        bandwidths: of its kernels.

    Raises:
        ValueError: no step counts.
    """
    used = placed.valid & (weight > 0)
    if not used.any():
        raise ValueError("steps: at least one must count, got none")
    place, direction, weight = placed.place[used], placed.direction[used], weight[used]
    low, high = (np.quantile(place, q, axis=0) for q in (config.QUANTILE, 1 - config.QUANTILE))
    low, high = low - config.MARGIN_M, high + config.MARGIN_M
    cell_m = max(config.CELL_M, float((high - low).max()) / (config.MOST_CELLS - 2))
    size = np.ceil((high - low) / cell_m).astype(np.int64) + 2
    at = (place - low) / cell_m
    slots, sd = bandwidths.slots, bandwidths.place_m / cell_m
    slot_idx = slot_of(time_s[used], slots)
    counts = np.stack(
        [
            _smoothed(_binned(at[own], direction[own], weight[own], size), bandwidths, cell_m)
            for own in (slot_idx == slot for slot in range(slots))
        ]
    )
    whole = counts.sum(axis=0)
    if slots > 1:
        counts = counts + config.SLOT_PEOPLE * whole / whole.sum()
    counts = counts / counts.sum(axis=(1, 2, 3), keepdims=True)
    counts = (1 - config.ANY_WAY) * counts + config.ANY_WAY * counts.mean(axis=3, keepdims=True)
    share = counts * (1 - config.ANYWHERE) + config.ANYWHERE / whole.size
    nodes = low + cell_m * np.indices(tuple(size.tolist())).reshape(2, -1).T
    seen = seen_at(nodes).reshape(size)
    node = cell_m**2 * 2 * np.pi / config.DIRECTIONS
    return PathDensityMap(
        corner=low,
        cell_m=cell_m,
        log_density=of_levels(to_levels(np.log(share / node))),
        elsewhere=float(np.log(config.ANYWHERE / whole.size / node)),
        unseen=np.rint((1 - seen) * 255) / 255,
        log_level=float(-np.log(max(seen.sum(), 1.0) * config.DIRECTIONS * node)),
        log_typical=float((share * np.log(share / node)).sum() / slots) - config.UNSEEN_COST,
        people=(whole.sum(axis=2) * 2 * np.pi * sd**2).astype(np.float32),
    )


def _binned(at: Array, direction: Array, weight: Array, size: npt.NDArray[np.int64]) -> Array:
    """Weights spread linearly over the nodes (X, Y, 16) around each step."""
    turn = (direction % (2 * np.pi)) / (2 * np.pi) * config.DIRECTIONS
    at = np.clip(at, 0, size - 1.001)
    first, way = np.floor(at).astype(np.int64), np.floor(turn).astype(np.int64)
    parts = np.concatenate([at - first, (turn - way)[:, None]], axis=1)
    counts = np.zeros((*size, config.DIRECTIONS))
    for corner in np.ndindex(2, 2, 2):
        share = np.where(np.array(corner) == 1, parts, 1 - parts).prod(axis=1)
        turned = (way + corner[2]) % config.DIRECTIONS
        node = (first[:, 0] + corner[0], first[:, 1] + corner[1], turned)
        np.add.at(counts, node, weight * share)
    return counts


def _smoothed(counts: Array, bandwidths: Bandwidths, cell_m: float) -> Array:
    """Counts (X, Y, 16) smoothed by a Gaussian over places and a von Mises over directions."""
    from scipy.linalg import circulant  # late: the HTTP process has no use for it

    sd = bandwidths.place_m / cell_m
    along = [circulant(_gaussian(length, sd)) for length in counts.shape[:2]]
    angles = np.arange(config.DIRECTIONS) * 2 * np.pi / config.DIRECTIONS
    kernel = np.exp(bandwidths.direction_kappa * (np.cos(angles) - 1))
    # Products of matrices, one for each axis, take a quarter of the time of Fourier transforms.
    smooth = along[1] @ np.tensordot(along[0], counts, axes=1)
    return np.asarray(np.clip(smooth @ circulant(kernel / kernel.sum()), 0.0, None))


def _gaussian(length: int, sd: float) -> Array:
    """Weights (length,) of nodes so many away, around the grid, by their Fourier transform."""
    rates = 2 * np.pi * np.fft.fftfreq(length)
    return np.asarray(np.fft.ifft(np.exp(-0.5 * (sd * rates) ** 2)).real)


def to_levels(log_density: Array) -> npt.NDArray[np.int16]:
    """Log densities between -500 and 500 as whole numbers, of the same shape."""
    return np.rint(log_density * config.LEVELS).astype(np.int16)


def of_levels(levels: npt.NDArray[np.int16]) -> Array:
    """The log densities of `to_levels`, rounded."""
    return levels.astype(np.float64) / config.LEVELS
