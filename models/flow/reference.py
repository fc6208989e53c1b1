"""Learn a site's flow from tracks at a known pose, and how registration errs there."""

from dataclasses import dataclass, replace

import numpy as np

from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.numbers import numbers_of
from models.flow.cross_fit import FOLDS, LOOSE_SD, CrossFit, cross_fit, dealt
from models.flow.evidence import walkers_of
from models.flow.fit_test import UsualFit, usual_fit
from models.flow.flow_map import FlowMap
from models.flow.move_test import StillScores, learn_scores
from models.flow.registration import Peak, Site
from models.flow.site_map import mapped, slots_worth
from models.flow.view import Coverage
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

FEWEST_PARTIES = 12
_PLAUSIBLE_OFFSET = np.array([np.radians(1.5), np.radians(1.5), 0.1, np.radians(1.5)])
_SURPRISE, _SURPRISE_WEIGHT, _LARGEST_SURPRISE = 1.3, 3.0, 16.0
_LEFT_NOISE = 0.5  # of an offset's, after what cancels


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowReference:
    """The flow at a site, and what registration says there beyond the truth.

    `offset` (4,) with covariance (4, 4), of tilt, roll, log height, heading; `temper` is how much
    larger squared errors are than the curvature at a peak says, and `surprise` than curvature and
    noise together say, for a map of endless people; this one is of `people`. `still` and `fit` are
    what its two tests go by.
    """

    flow: FlowMap
    coverage: Coverage
    offset: Array
    offset_covariance: Array
    temper: float
    surprise: float
    people: float
    still: StillScores
    fit: UsualFit

    def site(self, intrinsics: Intrinsics) -> Site:
        """What walkers are registered to."""
        return Site(flow=self.flow, coverage=self.coverage, intrinsics=intrinsics)

    def temper_for(self, people: float) -> float:
        """How much larger squared errors are for so many people than the curvature says."""
        return self.temper * self.map_noise(people)

    def map_noise(self, people: float) -> float:
        """The noise of map and walkers over that of the walkers.

        Who made the map pulls the new people's pose as far as they would, were they new.
        """
        return 1 + people / self.people


def candidate_of(pose: CameraPose) -> Array:
    """Tilt, roll, log height, heading (4,) of a pose."""
    return np.array([*numbers_of(pose), pose.heading_rad])


def learn_flow(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    seed: int,
    weights: Array | None = None,
) -> FlowReference | None:
    """The flow of tracks at the prior pose; None where fewer than 12 parties walk.

    A map knows the tracks that it is made of too well. So each quarter of the parties is registered
    against a map of the others: where the ends are on average is the offset, how far they scatter
    around it, against what curvature and noise say, is the surprise.

    Args:
        observations: of the tracks.
        intrinsics: of the camera.
        prior: where it stood.
        seed: of the quarters and of the bootstrap.
        weights: what each track (tracks,) counts for, 0 to 1; 1 unless they are given.
    """
    at = candidate_of(prior)
    walkers = walkers_of(observations, at)
    if walkers.parties < FEWEST_PARTIES:
        return None
    weights = np.ones(observations.tracks) if weights is None else weights
    fold_of = dealt(walkers, seed)
    parts = []
    for fold in range(FOLDS):
        known, asked = (np.flatnonzero((fold_of == fold) == own) for own in (False, True))
        left_out = walkers_of(of_tracks(observations, asked), at)
        if left_out.people:
            learned_of = walkers_of(of_tracks(observations, known), at)
            parts.append((learned_of, weights[known], left_out, asked))
    slots = slots_worth([part[:3] for part in parts], intrinsics, at)
    folds = [
        (mapped(known, own_weights, intrinsics, at, slots), left_out, asked)
        for known, own_weights, left_out, asked in parts
    ]
    crossed = cross_fit(folds, at)
    offset, noise, temper, surprise = _errors(crossed, at)
    plausible = np.diag(_PLAUSIBLE_OFFSET**2)
    kept = plausible @ np.linalg.inv(plausible + noise)
    whole = mapped(walkers, weights, intrinsics, at, slots)
    counted = weights[np.unique(walkers.steps.rows.owner_idx)]
    return FlowReference(
        flow=whole.flow,
        coverage=whole.coverage,
        offset=kept @ offset,
        offset_covariance=kept @ noise,
        temper=temper,
        surprise=surprise,
        people=float(counted.sum() ** 2 / (counted**2).sum()),
        still=learn_scores(crossed.scores, crossed.bent, seed),
        fit=usual_fit(crossed.fits),
    )


def precision_of(peak: Peak, noise: float) -> Array:
    """How much (4, 4) the map's part of a peak knows, if its noise is so many times its walkers'.

    Source: the inverse of the sandwich covariance (Godambe's information).
    """
    scatter = noise * peak.noise + 1e-9 * np.trace(peak.noise) * np.eye(4)
    return np.asarray(peak.curvature @ np.linalg.solve(scatter, peak.curvature))


def _errors(crossed: CrossFit, at: Array) -> tuple[Array, Array, float, float]:
    """The offset (4,), its covariance (4, 4), the temper and the surprise of a cross fit."""
    peaks, parties = crossed.peaks, crossed.parties
    # A fold's own parties are too few to say how they scatter.
    scatter = np.sum([peak.noise for peak in peaks], axis=0) / sum(parties)
    bent = np.sum([peak.curvature for peak in peaks], axis=0) / sum(parties)
    ends = np.array([peak.candidate - at for peak in peaks])
    loose = np.diag(LOOSE_SD**-2.0)
    own_covariances = [
        np.linalg.inv(precision_of(replace(peak, noise=scatter * count), 1.0) + loose)
        for peak, count in zip(peaks, parties, strict=True)
    ]
    # A fold's map is of three times its people, so that a third of the noise comes on top; and the
    # ends are held against their own mean.
    offset = ends.mean(axis=0)
    expected = FOLDS / (FOLDS - 1) * (1 - 1 / len(ends))
    surprises = [
        min(
            float((end - offset) @ np.linalg.solve(covariance, end - offset)) / 4 / expected,
            _LARGEST_SURPRISE,
        )
        for end, covariance in zip(ends, own_covariances, strict=True)
    ]
    total = sum(surprises) + _SURPRISE * _SURPRISE_WEIGHT
    surprise = max(1.0, total / (len(surprises) + _SURPRISE_WEIGHT))
    # Each in the others' map and they in its: to first order, what noise does to the ends cancels.
    noise = _LEFT_NOISE * surprise * np.mean(own_covariances, axis=0) / len(peaks)
    temper = surprise * max(1.0, 4 / float(np.trace(np.linalg.solve(scatter, bent))))
    return offset, noise, temper, surprise
