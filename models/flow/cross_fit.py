"""How a map errs about people whom it does not know: each quarter of them against the others."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.flow.evidence import Walkers
from models.flow.fit_test import party_fits
from models.flow.move_test import REACH, party_scores
from models.flow.registration import Belief, Peak, Site, register
from models.geometry.rotation import Array

FOLDS = 4
# How unsure the pose of a fold is before it is registered: so that its own end is seen.
LOOSE_SD = np.array([np.radians(6), np.radians(6), 0.3, np.radians(15)])


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossFit:
    """What folds of parties say of maps of all others, at and around the known pose.

    `peaks` are where registration ends, of `parties` each. `scores` (P, 4) and `fits` (P,) are of
    parties, scores in the order of time; `bent` (4, 4) has in a column how the mean score of a
    camera that has moved differs, for each number.
    """

    peaks: list[Peak]
    parties: list[int]
    scores: Array
    bent: Array
    fits: Array


def cross_fit(folds: list[tuple[Site, Walkers, npt.NDArray[np.int64]]], at: Array) -> CrossFit:
    """Ask each fold's walkers of the map of the others.

    Args:
        folds: the map, the walkers left out of it, and which tracks of all these are.
        at: the known pose (4,).
    """
    belief = Belief(mean=at, precision=np.diag(LOOSE_SD**-2.0))
    peaks = [
        register(walkers, site, belief, temper=1.0, headings=[0.0])[0] for site, walkers, _ in folds
    ]
    scored = [party_scores(walkers, site, at) for site, walkers, _ in folds]
    scores = np.concatenate([scores for scores, _ in scored])
    times = np.concatenate(
        [tracks[last] for (_, last), (_, _, tracks) in zip(scored, folds, strict=True)]
    )
    # A camera that has moved on sees people as one that stays would from a little back.
    bent = [
        (_mean_score(folds, at - step) - _mean_score(folds, at + step)) / (2 * reach)
        for step, reach in zip(np.diag(REACH), REACH, strict=True)
    ]
    return CrossFit(
        peaks=peaks,
        parties=[walkers.parties for _, walkers, _ in folds],
        scores=scores[np.argsort(times)],
        bent=np.stack(bent, axis=1),
        fits=np.concatenate([party_fits(walkers, site, at) for site, walkers, _ in folds]),
    )


def dealt(walkers: Walkers, seed: int) -> npt.NDArray[np.int64]:
    """The fold of each track: parties stay together, and are dealt out by chance."""
    parties = np.unique(walkers.party_idx)
    fold_of = np.random.default_rng(seed).permutation(parties.size) % FOLDS
    return np.asarray(fold_of[np.searchsorted(parties, walkers.party_idx)])


def _mean_score(folds: list[tuple[Site, Walkers, npt.NDArray[np.int64]]], at: Array) -> Array:
    found: list[Array] = [party_scores(walkers, site, at)[0] for site, walkers, _ in folds]
    return np.asarray(np.concatenate(found).mean(axis=0))
