"""Quarters of a site's people, each beside the paths of all the others: how a map errs is seen so.

Source: Stone 1974, cross-validation; walking groups stay together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index
from models.paths import config
from models.paths.likelihood import PathModel, Walkers, walkers_of
from models.paths.map_learning import Bandwidths, best_bandwidths, path_model_of
from models.paths.path_tests import group_fits, group_scores, sums_of_groups
from models.paths.registration import shape_at
from models.tracks.observations import Observations, of_tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """The paths of some tracks, `train_idx`, and the walkers of the others, `test_idx`."""

    paths: PathModel
    walkers: Walkers
    train_idx: Index
    test_idx: Index


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenBandwidths:
    """The bandwidths that predict people best, by so many `tracks`; the last ended `to_s`."""

    bandwidths: Bandwidths
    tracks: int
    to_s: float

    def hold_for(self, tracks: Observations) -> bool:
        """True if tracks are so much the same people's that the same is best for them."""
        soon = abs(float(tracks.ended_s.max()) - self.to_s) < config.HOLD_S
        return soon and tracks.tracks < config.MORE_TRACKS * self.tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class Folds:
    """All quarters, and the bandwidths of their maps."""

    each: tuple[Fold, ...]
    chosen: ChosenBandwidths


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossFit:
    """Scores of walking groups by the paths of all others, at and around the known pose.

    `slopes` (P, 4) are sums of a walking group's scores of `people` (P,) in it, `curvature` (4, 4)
    is of all. `scores` (P, 4), of the score test, and `fits` (P,) are of walking groups; slopes and
    scores are in the order of time. `bent` (4, 4) has in a column how the mean score of a camera
    that has moved differs, for each parameter.
    """

    slopes: Array
    people: Array
    curvature: Array
    scores: Array
    bent: Array
    fits: Array
    place_fits: Array


def fold_maps(
    observations: Observations,
    intrinsics: Intrinsics,
    at: Array,
    seed: int,
    weights: Array | None = None,
    chosen: ChosenBandwidths | None = None,
) -> Folds | None:
    """The paths of each three quarters of the groups; None where fewer than 12 groups walk.

    `at` (4,) is the known pose, `weights` (tracks,) are 0 to 1, else 1. Bandwidths that were
    `chosen` before are chosen anew where they do not hold.
    """
    walkers = walkers_of(observations, at)
    if walkers.walking_groups < config.FEWEST_GROUPS:
        return None
    weights = np.ones(observations.tracks) if weights is None else weights
    fold_of = _dealt(walkers, seed)
    parts = []
    for fold in range(config.FOLDS):
        train_idx, test_idx = (np.flatnonzero((fold_of == fold) == own) for own in (False, True))
        test = walkers_of(of_tracks(observations, test_idx), at)
        if test.people:
            train = walkers_of(of_tracks(observations, train_idx), at)
            parts.append((train, weights[train_idx], test, train_idx, test_idx))
    if chosen is None or not chosen.hold_for(observations):
        chosen = ChosenBandwidths(
            bandwidths=best_bandwidths([part[:3] for part in parts], intrinsics, at),
            tracks=observations.tracks,
            to_s=float(observations.ended_s.max()),
        )
    return Folds(
        each=tuple(
            Fold(
                paths=path_model_of(train, own, intrinsics, at, chosen.bandwidths),
                walkers=test,
                train_idx=train_idx,
                test_idx=test_idx,
            )
            for train, own, test, train_idx, test_idx in parts
        ),
        chosen=chosen,
    )


def _dealt(walkers: Walkers, seed: int) -> Index:
    """The fold of each track: walking groups stay together, and are dealt out by chance."""
    walking_groups = np.unique(walkers.group_idx)
    fold_of = np.random.default_rng(seed).permutation(walking_groups.size) % config.FOLDS
    return np.asarray(fold_of[np.searchsorted(walking_groups, walkers.group_idx)])


def cross_fit(folds: Sequence[Fold], at: Array) -> CrossFit:
    """The scores of each fold's walkers by the paths of the others, at the known pose (4,)."""
    scored = [group_scores(fold.walkers, fold.paths, at) for fold in folds]
    pairs = zip(scored, folds, strict=True)
    order = np.argsort(np.concatenate([fold.test_idx[last] for (_, last), fold in pairs]))
    sums = [sums_of_groups(fold.walkers, fold.paths.scores(fold.walkers, at, at)) for fold in folds]
    shapes = [shape_at(fold.walkers, fold.paths, at) for fold in folds]
    # A camera that has moved on sees people as one that stays would from a little back.
    bent = [
        (_mean_score(folds, at - step) - _mean_score(folds, at + step)) / (2 * reach)
        for step, reach in zip(np.diag(config.REACH), config.REACH, strict=True)
    ]
    return CrossFit(
        slopes=np.concatenate([own for own, _, _ in sums])[order],
        people=np.concatenate([people for _, people, _ in sums])[order].astype(np.float64),
        curvature=np.sum([shape.curvature for shape in shapes], axis=0),
        scores=np.concatenate([scores for scores, _ in scored])[order],
        bent=np.stack(bent, axis=1),
        fits=np.concatenate([group_fits(fold.walkers, fold.paths, at) for fold in folds]),
        place_fits=np.concatenate(
            [group_fits(fold.walkers, fold.paths.undirected, at) for fold in folds]
        ),
    )


def _mean_score(folds: Sequence[Fold], at: Array) -> Array:
    found: list[Array] = [group_scores(fold.walkers, fold.paths, at)[0] for fold in folds]
    return np.asarray(np.concatenate(found).mean(axis=0))
