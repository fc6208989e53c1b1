"""Learn a site's flow from tracks at a known pose, and how registration errs there."""

from dataclasses import dataclass

import numpy as np

from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.numbers import numbers_of
from models.flow.evidence import Walkers, walkers_of
from models.flow.flow_map import Coverage, FlowMap, coverage_of, learn_map
from models.flow.placement import place_steps
from models.flow.registration import Belief, register
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

FEWEST_WALKERS = 12
_FOLDS = 4
# How unsure the pose of a fold is before it is registered: so that its own end is seen.
_LOOSE_SD = np.array([np.radians(6), np.radians(6), 0.3, np.radians(15)])
_PLAUSIBLE_OFFSET = np.array([np.radians(1.5), np.radians(1.5), 0.1, np.radians(1.5)])
_SURPRISE, _SURPRISE_WEIGHT, _LARGEST_SURPRISE = 2.0, 2.0, 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowReference:
    """The flow at a site, and what registration says there beyond the truth.

    `offset` (4,) with covariance (4, 4), of tilt, roll, log height, heading; `temper` is how much
    larger squared errors are than scores say, before the offset is taken off.
    """

    flow: FlowMap
    coverage: Coverage
    offset: Array
    offset_covariance: Array
    temper: float


def candidate_of(pose: CameraPose) -> Array:
    """Tilt, roll, log height, heading (4,) of a pose."""
    return np.array([*numbers_of(pose), pose.heading_rad])


def learn_flow(
    observations: Observations, intrinsics: Intrinsics, prior: CameraPose, seed: int
) -> FlowReference | None:
    """The flow of tracks at the prior pose; None where fewer than 12 people walk.

    A map knows the tracks that it is made of too well. So each quarter of the tracks is registered
    against a map of the others: where the ends are on average is the offset, how far they scatter
    against what their scores say is the temper.
    """
    at = candidate_of(prior)
    if walkers_of(observations, at).people < FEWEST_WALKERS:
        return None
    order = np.random.default_rng(seed).permutation(observations.tracks)
    belief = Belief(mean=at, precision=np.diag(_LOOSE_SD**-2.0))
    ends, informations = [], []
    for fold in range(_FOLDS):
        left_out = np.zeros(observations.tracks, dtype=bool)
        left_out[order[fold::_FOLDS]] = True
        flow, coverage = _mapped(of_tracks(observations, np.flatnonzero(~left_out)), at)
        walkers = walkers_of(of_tracks(observations, np.flatnonzero(left_out)), at)
        if not walkers.people:
            continue
        peak = register(
            walkers, flow, coverage, intrinsics, belief, temper=1.0, headings=[0.0]
        )[0]  # fmt: skip
        ends.append(peak.candidate - at)
        informations.append(peak.information)
    apart = np.array(ends)
    offset = apart.mean(axis=0)
    # With the offset in: where it is large, the map is to be trusted less without it, too.
    surprises = [
        min(float(end @ information @ end) / 4, _LARGEST_SURPRISE)
        for end, information in zip(apart, informations, strict=True)
    ]
    total = sum(surprises) + _SURPRISE * _SURPRISE_WEIGHT
    temper = max(1.0, total / (len(surprises) + _SURPRISE_WEIGHT))
    noise = temper * np.linalg.inv(np.sum(informations, axis=0) + np.diag(_LOOSE_SD**-2.0))
    plausible = np.diag(_PLAUSIBLE_OFFSET**2)
    kept = plausible @ np.linalg.inv(plausible + noise)
    flow, coverage = _mapped(observations, at)
    return FlowReference(
        flow=flow,
        coverage=coverage,
        offset=kept @ offset,
        offset_covariance=kept @ noise,
        temper=temper,
    )


def _mapped(observations: Observations, at: Array) -> tuple[FlowMap, Coverage]:
    walkers = walkers_of(observations, at)
    flow = learn_map(place_steps(walkers.steps, at), _evenly(walkers))
    return flow, coverage_of(flow)


def _evenly(walkers: Walkers) -> Array:
    """Weights (M,) by which each track counts once."""
    number = np.bincount(walkers.owner_idx, minlength=walkers.tracks)
    return np.asarray(1.0 / number[walkers.owner_idx])
