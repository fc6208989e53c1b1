"""What a set of tracks says of a pose by the flow map: a log likelihood and its score by track."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.estimation.joint.observations import Observations, Steps
from models.flow.flow_map import Coverage, FlowMap
from models.flow.placement import place_steps
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array

_STANDING_MPS = 0.35
_TRACK_STEPS = 2.0  # a track tells as much as two independent steps at the most
_NO_GROUND = -30.0
_LEAST_SEEN = 1e-3
_DIFFERENCE = 0.01  # radians, and log height: for how much a camera sees of the map


@dataclass(frozen=True, slots=True, kw_only=True)
class Walkers:
    """Steps of people who move: weights (M,) that add up to at most 2 a track, owners (M,)."""

    steps: Steps
    owner_idx: npt.NDArray[np.int64]
    weight: Array
    tracks: int

    @property
    def people(self) -> int:
        """How many tracks have a step."""
        return int(np.unique(self.owner_idx).size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """A log likelihood of all tracks, and the score (N, 4) of each."""

    value: float
    scores: Array


def walkers_of(observations: Observations, candidate: Array) -> Walkers:
    """The steps that are walked, seen from a candidate (4,) that is about right."""
    steps = observations.steps
    placed = place_steps(steps, candidate)
    moving = placed.valid & (placed.length_m > _STANDING_MPS * steps.seconds)
    rows = np.flatnonzero(moving)
    owner_idx = steps.rows.owner_idx[rows]
    number = np.bincount(owner_idx, minlength=observations.tracks)
    return Walkers(
        steps=Steps(
            start_rays=steps.start_rays[rows],
            end_rays=steps.end_rays[rows],
            swayed_rays=steps.swayed_rays[rows],
            seconds=steps.seconds[rows],
            rows=steps.rows,
        ),
        owner_idx=owner_idx,
        weight=np.minimum(1.0, _TRACK_STEPS / number[owner_idx]),
        tracks=observations.tracks,
    )


def likelihood(
    walkers: Walkers, flow: FlowMap, coverage: Coverage, intrinsics: Intrinsics, candidate: Array
) -> Likelihood:
    """How likely the walkers' places and directions in the image are, given that they are seen."""
    placed = place_steps(walkers.steps, candidate)
    density, by_place, by_direction = flow.look(placed.place, placed.direction)
    ok = placed.valid
    value = np.where(ok, density + placed.log_ratio, _NO_GROUND)
    score = (
        np.einsum("mi,mik->mk", by_place, placed.d_place)
        + by_direction[:, None] * placed.d_direction
        + placed.d_log_ratio
    )
    score[~ok] = 0.0
    seen, d_seen = _seen(coverage, intrinsics, candidate)
    weight, owner = walkers.weight, walkers.owner_idx
    scores = np.zeros((walkers.tracks, 4))
    np.add.at(scores, owner, weight[:, None] * (score - d_seen))
    return Likelihood(value=float((weight * (value - seen)).sum()), scores=scores)


def _seen(coverage: Coverage, intrinsics: Intrinsics, candidate: Array) -> tuple[float, Array]:
    """The log of the share that is seen, and its differences (4,)."""

    def log_share(at: Array) -> float:
        return float(np.log(max(coverage.seen_from(intrinsics, at), _LEAST_SEEN)))

    slopes = [
        (log_share(candidate + step) - log_share(candidate - step)) / (2 * _DIFFERENCE)
        for step in _DIFFERENCE * np.eye(4)
    ]
    return log_share(candidate), np.array(slopes)
