"""From walkers at a known pose to a map that others can be registered to.

Source: Duin 1976, the width of a kernel by the likelihood of who was left out.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.paths.map.density_map import Bandwidths, learn_map, slot_of
from models.paths.map.placement import place_steps
from models.paths.map.view import coverage_of, in_view
from models.paths.registration import Site

_SHADE_M = 2.0  # over which the edge of what the reference saw is blurred, as the map is
_TRIED = (
    Bandwidths(),
    Bandwidths(place_m=0.7, direction_kappa=10.0),
    Bandwidths(place_m=0.5, direction_kappa=16.0),
)
_SLOTS = 4  # parts of a day: night, morning, afternoon, evening, wherever midnight UTC falls
_FEWEST_A_SLOT = 80  # people that a part of the day is asked by
_CLEAR = 3.0  # standard errors by which parts of the day must predict better


def mapped(
    walkers: Walkers, weights: Array, intrinsics: Intrinsics, at: Array, bandwidths: Bandwidths
) -> Site:
    """The map of walkers seen from a known pose (4,), each counted by its weight (tracks,)."""
    flow = learn_map(
        place_steps(walkers.steps, at),
        _evenly(walkers) * weights[walkers.steps.rows.owner_idx],
        walkers.steps.rows.time_s,
        lambda places: in_view(intrinsics, at, places, _SHADE_M),
        bandwidths,
    )
    return Site(flow=flow, coverage=coverage_of(flow), intrinsics=intrinsics)


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
        found = []
        for known, weights, asked in folds:
            site = mapped(known, weights, intrinsics, at, bandwidths)
            found.append(_held_out_log_likelihoods(asked, site, at))
        return np.concatenate(found)

    asked = {tried: held_out(tried) for tried in _TRIED}
    best = max(asked, key=lambda tried: float(asked[tried].mean()))
    everyone = np.concatenate([_slot_of_people(walkers) for _, _, walkers in folds])
    if (np.bincount(everyone, minlength=_SLOTS) >= _FEWEST_A_SLOT).sum() < 2:
        return best
    by_day = replace(best, slots=_SLOTS)
    gains = held_out(by_day) - asked[best]
    return by_day if gains.mean() > _CLEAR * gains.std() / np.sqrt(gains.size) else best


def _held_out_log_likelihoods(walkers: Walkers, site: Site, at: Array) -> Array:
    """The mean log density (P,) of each person, whom the map has no part of."""
    placed = place_steps(walkers.steps, at)
    rows = walkers.steps.rows
    slot_idx = site.flow.slot_of(rows.time_s)
    value, _, _ = site.flow.look(placed.place, placed.direction, slot_idx)
    sums = np.bincount(rows.owner_idx, _evenly(walkers) * value, walkers.tracks)
    return np.asarray(sums[np.unique(rows.owner_idx)])


def _slot_of_people(walkers: Walkers) -> npt.NDArray[np.int64]:
    rows = walkers.steps.rows
    _, first = np.unique(rows.owner_idx, return_index=True)
    return slot_of(rows.time_s[first], _SLOTS)


def _evenly(walkers: Walkers) -> Array:
    """Weights (M,) by which each track counts once."""
    owner_idx = walkers.steps.rows.owner_idx
    number = np.bincount(owner_idx, minlength=walkers.tracks)
    return np.asarray(1.0 / number[owner_idx])
