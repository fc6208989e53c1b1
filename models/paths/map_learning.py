"""The path model of walkers at a known pose, which others can be registered to.

Source: Silverman 1982, a kernel density by binning; von Mises kernels over directions are Hall,
Watson and Cabrera's, 1987; Duin 1976, the width of a kernel by the likelihood of who was left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index
from models.paths import config
from models.paths.coverage import coverage_of, in_view
from models.paths.density_map import PathDensityMap, of_levels, slot_of, to_levels
from models.paths.ground_steps import Placement, place_steps
from models.paths.likelihood import PathModel, Walkers


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidths:
    """Of a map: the Gaussian's over places, the von Mises kernel's over directions, the day's.

    `slots` is the number of equal parts of the day.
    """

    place_m: float
    direction_kappa: float
    slots: int = 1


def path_model_of(
    walkers: Walkers, weights: Array, intrinsics: Intrinsics, at: Array, bandwidths: Bandwidths
) -> PathModel:
    """The paths of walkers seen from a known pose (4,), each counted by its weight (tracks,)."""
    density = learn_map(
        place_steps(walkers.steps, at),
        _evenly(walkers) * weights[walkers.steps.rows.owner_idx],
        walkers.steps.rows.time_s,
        lambda places: in_view(intrinsics, at, places, config.SHADE_M),
        bandwidths,
    )
    return PathModel(density=density, coverage=coverage_of(density), intrinsics=intrinsics)


def best_bandwidths(
    folds: list[tuple[Walkers, Array, Walkers]], intrinsics: Intrinsics, at: Array
) -> Bandwidths:
    """The bandwidths that predict people best; parts of the day where it is clear that they do.

    `folds` are walkers to learn of with their weights, and others to predict, at a known pose (4,).
    """

    def held_out(bandwidths: Bandwidths) -> Array:
        each = []
        for train, weights, test in folds:
            paths = path_model_of(train, weights, intrinsics, at, bandwidths)
            each.append(_held_out_log_likelihoods(test, paths.density, at))
        return np.concatenate(each)

    tried = [Bandwidths(place_m=m, direction_kappa=kappa) for m, kappa in config.BANDWIDTHS]
    found = {own: held_out(own) for own in tried}
    best = max(found, key=lambda own: float(found[own].mean()))
    everyone = np.concatenate([_slot_of_people(walkers) for _, _, walkers in folds])
    if (np.bincount(everyone, minlength=config.SLOTS) >= config.PEOPLE_OF_A_SLOT).sum() < 2:
        return best
    by_day = replace(best, slots=config.SLOTS)
    gains = held_out(by_day) - found[best]
    return by_day if gains.mean() > config.CLEARLY * gains.std() / np.sqrt(gains.size) else best


def _held_out_log_likelihoods(walkers: Walkers, density: PathDensityMap, at: Array) -> Array:
    """The mean log density (P,) of each person, whom the map has no part of."""
    placed = place_steps(walkers.steps, at)
    rows = walkers.steps.rows
    slot_idx = density.slot_of(rows.time_s)
    value, _, _ = density.log_density_at(placed.place, placed.direction, slot_idx)
    sums = np.bincount(rows.owner_idx, _evenly(walkers) * value, walkers.tracks)
    return np.asarray(sums[np.unique(rows.owner_idx)])


def _slot_of_people(walkers: Walkers) -> Index:
    rows = walkers.steps.rows
    _, first = np.unique(rows.owner_idx, return_index=True)
    return slot_of(rows.time_s[first], config.SLOTS)


def _evenly(walkers: Walkers) -> Array:
    """Weights (M,) by which each track counts once."""
    owner_idx = walkers.steps.rows.owner_idx
    number = np.bincount(owner_idx, minlength=walkers.tracks)
    return np.asarray(1.0 / number[owner_idx])


def learn_map(
    placed: Placement,
    weight: Array,
    time_s: Array,
    seen_at: Callable[[Array], Array],
    bandwidths: Bandwidths,
) -> PathDensityMap:
    """The map of steps seen from a known pose, each counted by its weight (M,).

    Those of a person add up to how much that person counts; `time_s` (M,) is when each was.
    `seen_at` says which part (N,) of the ground around places (N, 2) that pose sees.

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


def _binned(at: Array, direction: Array, weight: Array, size: Index) -> Array:
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
