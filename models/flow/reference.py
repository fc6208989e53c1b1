"""Learn a site's flow from tracks at a known pose, and how registration errs there."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.numbers import numbers_of
from models.flow.evidence import Walkers, walkers_of
from models.flow.flow_map import FlowMap, learn_map
from models.flow.placement import place_steps
from models.flow.registration import Belief, Peak, Site, register
from models.flow.view import Coverage, coverage_of, in_view
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

FEWEST_PARTIES = 12
_FOLDS = 4
_SHADE_M = 2.0  # over which the edge of what the reference saw is blurred, as the map is
# How unsure the pose of a fold is before it is registered: so that its own end is seen.
_LOOSE_SD = np.array([np.radians(6), np.radians(6), 0.3, np.radians(15)])
_PLAUSIBLE_OFFSET = np.array([np.radians(1.5), np.radians(1.5), 0.1, np.radians(1.5)])
_SURPRISE, _SURPRISE_WEIGHT, _LARGEST_SURPRISE = 1.3, 3.0, 16.0
_LEFT_NOISE = 0.5  # of an offset's, after what cancels


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowReference:
    """The flow at a site, and what registration says there beyond the truth.

    `offset` (4,) with covariance (4, 4), of tilt, roll, log height, heading; `temper` is how much
    larger squared errors are than the curvature at a peak says, and `surprise` than curvature and
    noise together say, for a map of endless people; this one is of `people`.
    """

    flow: FlowMap
    coverage: Coverage
    offset: Array
    offset_covariance: Array
    temper: float
    surprise: float
    people: float

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
    observations: Observations, intrinsics: Intrinsics, prior: CameraPose, seed: int
) -> FlowReference | None:
    """The flow of tracks at the prior pose; None where fewer than 12 parties walk.

    A map knows the tracks that it is made of too well. So each quarter of the parties is registered
    against a map of the others: where the ends are on average is the offset, how far they scatter
    around it, against what curvature and noise say, is the surprise.
    """
    at = candidate_of(prior)
    walkers = walkers_of(observations, at)
    if walkers.parties < FEWEST_PARTIES:
        return None
    mapped = partial(_mapped, intrinsics=intrinsics, at=at)
    belief = Belief(mean=at, precision=np.diag(_LOOSE_SD**-2.0))
    fold_of = _folds(walkers, seed)
    peaks: list[Peak] = []
    parties: list[int] = []
    for fold in range(_FOLDS):
        left_out = fold_of == fold
        own = walkers_of(of_tracks(observations, np.flatnonzero(left_out)), at)
        if own.people:
            site = mapped(walkers_of(of_tracks(observations, np.flatnonzero(~left_out)), at))
            peaks += register(own, site, belief, temper=1.0, headings=[0.0])[:1]
            parties.append(own.parties)
    # A fold's own parties are too few to say how they scatter.
    scatter = np.sum([peak.noise for peak in peaks], axis=0) / sum(parties)
    bent = np.sum([peak.curvature for peak in peaks], axis=0) / sum(parties)
    ends = np.array([peak.candidate - at for peak in peaks])
    loose = np.diag(_LOOSE_SD**-2.0)
    own_covariances = [
        np.linalg.inv(precision_of(replace(peak, noise=scatter * count), 1.0) + loose)
        for peak, count in zip(peaks, parties, strict=True)
    ]
    # A fold's map is of three times its people, so that a third of the noise comes on top; and the
    # ends are held against their own mean.
    offset = ends.mean(axis=0)
    expected = _FOLDS / (_FOLDS - 1) * (1 - 1 / len(ends))
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
    plausible = np.diag(_PLAUSIBLE_OFFSET**2)
    kept = plausible @ np.linalg.inv(plausible + noise)
    whole = mapped(walkers)
    return FlowReference(
        flow=whole.flow,
        coverage=whole.coverage,
        offset=kept @ offset,
        offset_covariance=kept @ noise,
        temper=surprise * max(1.0, 4 / float(np.trace(np.linalg.solve(scatter, bent)))),
        surprise=surprise,
        people=float(walkers.people),
    )


def precision_of(peak: Peak, noise: float) -> Array:
    """How much (4, 4) the map's part of a peak knows, if its noise is so many times its walkers'.

    Source: the inverse of the sandwich covariance (Godambe's information).
    """
    scatter = noise * peak.noise + 1e-9 * np.trace(peak.noise) * np.eye(4)
    return np.asarray(peak.curvature @ np.linalg.solve(scatter, peak.curvature))


def _folds(walkers: Walkers, seed: int) -> npt.NDArray[np.int64]:
    """The fold of each track: parties stay together, and are dealt out by chance."""
    parties = np.unique(walkers.party_idx)
    dealt = np.random.default_rng(seed).permutation(parties.size) % _FOLDS
    return np.asarray(dealt[np.searchsorted(parties, walkers.party_idx)])


def _mapped(walkers: Walkers, intrinsics: Intrinsics, at: Array) -> Site:
    flow = learn_map(
        place_steps(walkers.steps, at),
        _evenly(walkers),
        walkers.steps.rows.time_s,
        lambda places: in_view(intrinsics, at, places, _SHADE_M),
    )
    return Site(flow=flow, coverage=coverage_of(flow), intrinsics=intrinsics)


def _evenly(walkers: Walkers) -> Array:
    """Weights (M,) by which each track counts once."""
    owner_idx = walkers.steps.rows.owner_idx
    number = np.bincount(owner_idx, minlength=walkers.tracks)
    return np.asarray(1.0 / number[owner_idx])
