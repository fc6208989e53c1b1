"""Quarters of a site's people, each beside a map of all the others: how a map errs is seen so.

Source: Stone 1974, cross-validation; walking groups stay together.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.doors.door_map import DoorGrain
from models.estimation.joint.observations import Observations, of_tracks
from models.flow.likelihood import Walkers, walkers_of
from models.flow.map.flow_map import Grain
from models.flow.registration import Site
from models.flow.site_doors import Quarter, door_grain
from models.flow.site_map import best_grain, mapped
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array

FEWEST_GROUPS = 12
_FOLDS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A map of the tracks `known`, and the walkers left out of it: they are the tracks `asked`."""

    site: Site
    walkers: Walkers
    known: npt.NDArray[np.int64]
    asked: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Folds:
    """All quarters, and the grains of map and doors that predict people best.

    There is no grain of doors where there are none.
    """

    each: tuple[Fold, ...]
    grain: Grain
    door_grain: DoorGrain | None


def fold_maps(
    observations: Observations,
    intrinsics: Intrinsics,
    at: Array,
    seed: int,
    weights: Array | None = None,
) -> Folds | None:
    """A map of each three quarters of the groups; None where fewer than 12 groups walk.

    Args:
        observations: of the tracks.
        intrinsics: of the camera.
        at: the known pose (4,).
        seed: of the quarters; walking groups stay together.
        weights: what each track (tracks,) counts for, 0 to 1; 1 unless they are given.
    """
    walkers = walkers_of(observations, at)
    if walkers.walking_groups < FEWEST_GROUPS:
        return None
    weights = np.ones(observations.tracks) if weights is None else weights
    fold_of = _dealt(walkers, seed)
    parts = []
    for fold in range(_FOLDS):
        known, asked = (np.flatnonzero((fold_of == fold) == own) for own in (False, True))
        left_out = walkers_of(of_tracks(observations, asked), at)
        if left_out.people:
            learned_of = walkers_of(of_tracks(observations, known), at)
            parts.append((learned_of, left_out, known, asked))
    grain = best_grain(
        [(of, weights[known], left_out) for of, left_out, known, _ in parts], intrinsics, at
    )
    quarters = [
        Quarter(
            known=of,
            weights=weights[known],
            asked=left_out,
            site=mapped(of, weights[known], intrinsics, at, grain),
        )
        for of, left_out, known, _ in parts
    ]
    doors, sites = door_grain(quarters, at)
    return Folds(
        each=tuple(
            Fold(site=site, walkers=left_out, known=known, asked=asked)
            for site, (_, left_out, known, asked) in zip(sites, parts, strict=True)
        ),
        grain=grain,
        door_grain=doors,
    )


def _dealt(walkers: Walkers, seed: int) -> npt.NDArray[np.int64]:
    """The fold of each track: walking groups stay together, and are dealt out by chance."""
    walking_groups = np.unique(walkers.group_idx)
    fold_of = np.random.default_rng(seed).permutation(walking_groups.size) % _FOLDS
    return np.asarray(fold_of[np.searchsorted(walking_groups, walkers.group_idx)])
