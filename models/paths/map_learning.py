"""The path model of walkers at a known pose, which others can be registered to.

Source: Duin 1976, the width of a kernel by the likelihood of who was left out.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.paths import config
from models.paths.coverage import coverage_of, in_view
from models.paths.density_map import Bandwidths, PathDensityMap, learn_map, slot_of
from models.paths.ground_steps import place_steps
from models.paths.likelihood import PathModel, Walkers


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

    Args:
        folds: walkers to learn of with their weights, and others to predict.
        intrinsics: of the camera.
        at: the known pose (4,).
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


def _slot_of_people(walkers: Walkers) -> npt.NDArray[np.int64]:
    rows = walkers.steps.rows
    _, first = np.unique(rows.owner_idx, return_index=True)
    return slot_of(rows.time_s[first], config.SLOTS)


def _evenly(walkers: Walkers) -> Array:
    """Weights (M,) by which each track counts once."""
    owner_idx = walkers.steps.rows.owner_idx
    number = np.bincount(owner_idx, minlength=walkers.tracks)
    return np.asarray(1.0 / number[owner_idx])
