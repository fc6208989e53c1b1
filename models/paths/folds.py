"""Quarters of a site's people, each beside a map of all the others: how a map errs is seen so.

Source: Stone 1974, cross-validation; walking groups stay together.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.durations import HOUR_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.paths.likelihood import Walkers, walkers_of
from models.paths.map.density_map import Bandwidths
from models.paths.registration import Site
from models.paths.site_map import best_bandwidths, mapped
from models.tracks.observations import Observations, of_tracks

FEWEST_GROUPS = 12
_FOLDS = 4
# Bandwidths are chosen anew of twice as many tracks, which bear finer ones, and in the next part of
# a day, in which people may walk elsewhere: to choose takes a sixth of the time of learning a map.
_MORE, _HOLD_S = 2, 6 * HOUR_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """A map of the tracks `known`, and the walkers left out of it: they are the tracks `asked`."""

    site: Site
    walkers: Walkers
    known: npt.NDArray[np.int64]
    asked: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenBandwidths:
    """The bandwidths that predict people best, by so many `tracks`; the last ended `to_s`."""

    bandwidths: Bandwidths
    tracks: int
    to_s: float

    def hold_for(self, tracks: Observations) -> bool:
        """Whether tracks are so much the same people's that the same is best for them."""
        soon = abs(float(tracks.ended_s.max()) - self.to_s) < _HOLD_S
        return soon and tracks.tracks < _MORE * self.tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class Folds:
    """All quarters, and the bandwidths of their maps."""

    each: tuple[Fold, ...]
    chosen: ChosenBandwidths


def fold_maps(
    observations: Observations,
    intrinsics: Intrinsics,
    at: Array,
    seed: int,
    weights: Array | None = None,
    chosen: ChosenBandwidths | None = None,
) -> Folds | None:
    """A map of each three quarters of the groups; None where fewer than 12 groups walk.

    Args:
        observations: of the tracks.
        intrinsics: of the camera.
        at: the known pose (4,).
        seed: of the quarters; walking groups stay together.
        weights: what each track (tracks,) counts for, 0 to 1; 1 unless they are given.
        chosen: bandwidths, before; they are chosen anew where they do not hold.
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
    if chosen is None or not chosen.hold_for(observations):
        learned = [(of, weights[known], left_out) for of, left_out, known, _ in parts]
        chosen = ChosenBandwidths(
            bandwidths=best_bandwidths(learned, intrinsics, at),
            tracks=observations.tracks,
            to_s=float(observations.ended_s.max()),
        )
    return Folds(
        each=tuple(
            Fold(
                site=mapped(of, weights[known], intrinsics, at, chosen.bandwidths),
                walkers=left_out,
                known=known,
                asked=asked,
            )
            for of, left_out, known, asked in parts
        ),
        chosen=chosen,
    )


def _dealt(walkers: Walkers, seed: int) -> npt.NDArray[np.int64]:
    """The fold of each track: walking groups stay together, and are dealt out by chance."""
    walking_groups = np.unique(walkers.group_idx)
    fold_of = np.random.default_rng(seed).permutation(walking_groups.size) % _FOLDS
    return np.asarray(fold_of[np.searchsorted(walking_groups, walkers.group_idx)])
