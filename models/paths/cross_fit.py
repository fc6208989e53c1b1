"""How a map errs about people whom it does not know: each quarter of them against the others.

Source: Stone 1974, cross-validation; what is left out are walking groups.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.paths.folds import Fold
from models.paths.likelihood import Walkers
from models.paths.path_test import group_fits
from models.paths.registration import curvature_of
from models.paths.turn_detection import REACH, group_scores, groups_in_time


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossFit:
    """What folds of walking groups say of maps of all others, at and around the known pose.

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


def cross_fit(folds: Sequence[Fold], at: Array) -> CrossFit:
    """Ask each fold's walkers of the map of the others, at the known pose (4,)."""
    scored = [group_scores(fold.walkers, fold.site, at) for fold in folds]
    scores = np.concatenate([scores for scores, _ in scored])
    times = np.concatenate(
        [fold.asked[last] for (_, last), fold in zip(scored, folds, strict=True)]
    )
    order = np.argsort(times)
    sums = [_group_sums(fold.walkers, fold.site.scores(fold.walkers, at, at)) for fold in folds]
    # A camera that has moved on sees people as one that stays would from a little back.
    bent = [
        (_mean_score(folds, at - step) - _mean_score(folds, at + step)) / (2 * reach)
        for step, reach in zip(np.diag(REACH), REACH, strict=True)
    ]
    return CrossFit(
        slopes=np.concatenate([own for own, _ in sums])[order],
        people=np.concatenate([people for _, people in sums])[order],
        curvature=np.sum([curvature_of(fold.walkers, fold.site, at) for fold in folds], axis=0),
        scores=scores[order],
        bent=np.stack(bent, axis=1),
        fits=np.concatenate([group_fits(fold.walkers, fold.site, at) for fold in folds]),
    )


def _group_sums(walkers: Walkers, scores: Array) -> tuple[Array, Array]:
    """Sums (P, 4) of the scores of each group, and its people (P,), in the order of time."""
    people, group_of, _ = groups_in_time(walkers)
    size = np.bincount(group_of)
    sums = np.zeros((size.size, 4))
    np.add.at(sums, group_of, scores[people])
    return sums, size.astype(np.float64)


def _mean_score(folds: Sequence[Fold], at: Array) -> Array:
    found: list[Array] = [group_scores(fold.walkers, fold.site, at)[0] for fold in folds]
    return np.asarray(np.concatenate(found).mean(axis=0))
