"""What a set of tracks says of a pose by the flow map: a log likelihood and its score by track.

Ours: log p(image) = log f(place, direction) + log |d(place, direction) / d(image)| - log share,
where the share is that of the map which the camera sees; a track's steps count for two at the most.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.ground_flow import rotation_and_turns
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, rotation_from_angles
from models.paths.compiled.steps import (
    busiest,
    known_scores_of_tracks,
    likelihood_of_tracks,
    tell,
    values_of_tracks,
)
from models.paths.map.density_map import FlowMap
from models.paths.map.placement import place_steps
from models.paths.map.view import Coverage, known_shares
from models.tracks.observations import Observations, Steps, steps_where
from models.walking.groups import walking_groups_of

_STANDING_MPS = 0.35
_TRACK_STEPS = 2.0  # a track tells as much as two independent steps at the most
_LEAST_SEEN = 1e-3
_DIFFERENCE = 0.01  # radians, and log height
_AROUND = _DIFFERENCE * np.concatenate([np.eye(4), -np.eye(4)])
# How busy ground is that the reference did not see, against the known: tried, and a prior on it.
_BUSY_LOG = np.linspace(math.log(0.02), math.log(4.0), 9)
_BUSY_MEAN, _BUSY_SD = math.log(0.5), 1.0
_BUSY = np.exp(_BUSY_LOG)
_BUSY_PRIOR = -0.5 * ((_BUSY_LOG - _BUSY_MEAN) / _BUSY_SD) ** 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Walkers:
    """Steps of people who move.

    `weight` (M,) adds up to at most 2 a track; `group_idx` (tracks,) is the walking group of each
    track.
    """

    steps: Steps
    weight: Array
    group_idx: npt.NDArray[np.int64]
    tracks: int

    @property
    def people(self) -> int:
        """How many tracks have a step."""
        return int(np.unique(self.steps.rows.owner_idx).size)

    @property
    def walking_groups(self) -> int:
        """How many walking groups have a step."""
        return int(np.unique(self.group_idx[np.unique(self.steps.rows.owner_idx)]).size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """A log likelihood of all tracks, and what each has in it: values (N,), scores (N, 4)."""

    value: float
    values: Array
    scores: Array


def walkers_of(observations: Observations, candidate: Array) -> Walkers:
    """The steps that are walked, seen from a candidate (4,) that is about right."""
    placed = place_steps(observations.steps, candidate)
    moving = placed.valid & (placed.length_m > _STANDING_MPS * observations.steps.seconds)
    steps = steps_where(observations.steps, moving)
    rows = steps.rows
    way = np.stack([np.cos(placed.direction), np.sin(placed.direction)], axis=1)
    number = np.bincount(rows.owner_idx, minlength=observations.tracks)
    return Walkers(
        steps=steps,
        weight=np.minimum(1.0, _TRACK_STEPS / number[rows.owner_idx]),
        group_idx=walking_groups_of(
            rows.time_s, rows.owner_idx, placed.place[moving], way[moving], observations.tracks
        ),
        tracks=observations.tracks,
    )


def likelihood(
    walkers: Walkers,
    flow: FlowMap,
    coverage: Coverage,
    intrinsics: Intrinsics,
    candidate: Array,
) -> Likelihood:
    """How likely the walkers' places and directions in the image are, given that they are seen.

    How busy the ground is that the reference did not see is whatever suits the tracks best: a
    camera that has turned to a square must not be pulled back for it, nor sent to an empty one.
    """
    slot_idx, log_height = flow.slot_of(walkers.steps.rows.time_s), float(candidate[2])
    told = tell(*_rays(walkers), slot_idx, flow.grid, *_rotation(candidate), log_height)
    shares, beyonds = coverage.seen_from(intrinsics, np.array([candidate, *candidate + _AROUND]))
    seen, beyond = np.maximum(shares[0], _LEAST_SEEN), float(beyonds[0])
    typical = math.exp(flow.log_typical)
    weight = np.ascontiguousarray(walkers.weight)
    busy = busiest(told, weight, slot_idx, typical, seen, beyond, _BUSY, _BUSY_PRIOR)
    in_all = seen + busy * beyond
    slopes = _slopes(shares[1:]) + busy * _slopes(beyonds[1:, None])
    values, scores = likelihood_of_tracks(
        told,
        weight,
        np.ascontiguousarray(walkers.steps.rows.owner_idx),
        slot_idx,
        busy * typical,
        np.log(in_all),
        np.ascontiguousarray(slopes / in_all[:, None]),
        walkers.tracks,
    )
    return Likelihood(value=float(values.sum()), values=values, scores=scores)


def track_values(
    walkers: Walkers,
    flow: FlowMap,
    coverage: Coverage,
    intrinsics: Intrinsics,
    candidates: Array,
) -> Array:
    """The values (K, N) of `likelihood` seen from candidates (K, 4), without scores.

    Some at once, which takes half of the time.
    """
    seen, beyond = coverage.seen_from(intrinsics, candidates)
    return values_of_tracks(
        *_rays(walkers),
        np.ascontiguousarray(walkers.weight),
        np.ascontiguousarray(walkers.steps.rows.owner_idx),
        flow.slot_of(walkers.steps.rows.time_s),
        flow.grid,
        rotation_from_angles(candidates[:, 0], candidates[:, 1], candidates[:, 3]),
        np.ascontiguousarray(candidates[:, 2]),
        math.exp(flow.log_typical),
        np.maximum(seen, _LEAST_SEEN),
        beyond,
        _BUSY,
        _BUSY_PRIOR,
        walkers.tracks,
    )


def anchored_scores(
    walkers: Walkers,
    flow: FlowMap,
    coverage: Coverage,
    intrinsics: Intrinsics,
    candidates: Array,
    anchor: Array,
) -> Array:
    """Scores (..., N, 4) at candidates (..., 4) of people in parts of the picture that are known.

    Which see known ground is decided at an anchor (4,), about where the candidates are, and stays
    so. Unlike the whole likelihood's, the mean of these scores is nothing at the truth whatever
    people do on ground that the reference did not see.
    """
    flat = candidates.reshape(-1, 4)
    shares = known_shares(coverage, flow, intrinsics, flat[:, None] + _AROUND, anchor)
    turned = [_rotation(candidate) for candidate in flat]
    scores = known_scores_of_tracks(
        *_rays(walkers),
        np.ascontiguousarray(walkers.weight),
        np.ascontiguousarray(walkers.steps.rows.owner_idx),
        flow.slot_of(walkers.steps.rows.time_s),
        flow.grid,
        np.array([rotation for rotation, _ in turned]),
        np.array([turns for _, turns in turned]),
        np.exp(flat[:, 2]),
        rotation_from_angles(anchor[0], anchor[1], anchor[3]),
        math.exp(anchor[2]),
        np.array([_slopes(np.log(np.maximum(around, _LEAST_SEEN))) for around in shares]),
        walkers.tracks,
    )
    return scores.reshape(*candidates.shape[:-1], walkers.tracks, 4)


def _rays(walkers: Walkers) -> tuple[Array, Array]:
    """Those to both ends of the steps (M, 3), in rows in memory."""
    steps = walkers.steps
    return np.ascontiguousarray(steps.start_rays), np.ascontiguousarray(steps.end_rays)


def _rotation(candidate: Array) -> tuple[Array, Array]:
    """That of a candidate (4,), `camera_from_world` (3, 3), and its turns (2, 3, 3)."""
    return rotation_and_turns(*(float(candidate[number]) for number in (0, 1, 3)))


def _slopes(around: Array) -> Array:
    """How what is known (8, S) around a candidate changes with it (S, 4)."""
    return np.asarray((around[:4] - around[4:]).T / (2 * _DIFFERENCE))
