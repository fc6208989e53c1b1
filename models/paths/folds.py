"""Quarters of a site's people, each beside a map of all the others: how a map errs is seen so.

Source: Stone 1974, cross-validation; walking groups stay together.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.doors.door_map import DoorGrain
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.paths.likelihood import Walkers, walkers_of
from models.paths.map.density_map import Grain
from models.paths.registration import Site
from models.paths.site_doors import Quarter, door_grain, with_quarters_doors
from models.paths.site_map import best_grain, mapped
from models.tracks.observations import Observations, of_tracks

FEWEST_GROUPS = 12
_FOLDS = 4
# Grains are chosen anew of twice as many tracks, which bear a finer one, and in the next part of a
# day, in which people may walk elsewhere: to choose takes a sixth of the time of learning a map.
_MORE, _HOLD_S = 2, 6 * 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A map of the tracks `known`, and the walkers left out of it: they are the tracks `asked`."""

    site: Site
    walkers: Walkers
    known: npt.NDArray[np.int64]
    asked: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Grains:
    """The grains of map and doors that predict people best; without doors, these have none.

    They were chosen of so many `tracks`, the last of which ended `to_s`.
    """

    flow: Grain
    doors: DoorGrain | None
    tracks: int
    to_s: float

    def hold_for(self, tracks: Observations) -> bool:
        """Whether tracks are so much the same people's that the same is best for them."""
        soon = abs(float(tracks.ended_s.max()) - self.to_s) < _HOLD_S
        return soon and tracks.tracks < _MORE * self.tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class Folds:
    """All quarters, and the grains of their maps and doors."""

    each: tuple[Fold, ...]
    grains: Grains


def fold_maps(
    observations: Observations,
    intrinsics: Intrinsics,
    at: Array,
    seed: int,
    weights: Array | None = None,
    grains: Grains | None = None,
) -> Folds | None:
    """A map of each three quarters of the groups; None where fewer than 12 groups walk.

    Args:
        observations: of the tracks.
        intrinsics: of the camera.
        at: the known pose (4,).
        seed: of the quarters; walking groups stay together.
        weights: what each track (tracks,) counts for, 0 to 1; 1 unless they are given.
        grains: that were chosen before; they are chosen anew where they do not hold.
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
    kept = grains if grains is not None and grains.hold_for(observations) else None
    if kept is None:
        learned = [(of, weights[known], left_out) for of, left_out, known, _ in parts]
        grain = best_grain(learned, intrinsics, at)
    else:
        grain = kept.flow
    quarters = [
        Quarter(
            known=of,
            weights=weights[known],
            asked=left_out,
            site=mapped(of, weights[known], intrinsics, at, grain),
        )
        for of, left_out, known, _ in parts
    ]
    if kept is None:
        doors, sites = door_grain(quarters, at)
        to_s = float(observations.ended_s.max())
        kept = Grains(flow=grain, doors=doors, tracks=observations.tracks, to_s=to_s)
    else:
        sites = with_quarters_doors(quarters, at, kept.doors)
    return Folds(
        each=tuple(
            Fold(site=site, walkers=left_out, known=known, asked=asked)
            for site, (_, left_out, known, asked) in zip(sites, parts, strict=True)
        ),
        grains=kept,
    )


def _dealt(walkers: Walkers, seed: int) -> npt.NDArray[np.int64]:
    """The fold of each track: walking groups stay together, and are dealt out by chance."""
    walking_groups = np.unique(walkers.group_idx)
    fold_of = np.random.default_rng(seed).permutation(walking_groups.size) % _FOLDS
    return np.asarray(fold_of[np.searchsorted(walking_groups, walkers.group_idx)])
