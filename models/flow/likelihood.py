"""What a set of tracks says of a pose by the flow map: a log likelihood and its score by track.

Ours: log p(image) = log f(place, direction) + log |d(place, direction) / d(image)| - log share,
where the share is that of the map which the camera sees; a track's steps count for two at the most.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.estimation.joint.groups import walking_groups_of
from models.estimation.joint.observations import Observations, Steps, steps_where
from models.flow.map.flow_map import FlowMap
from models.flow.map.placement import place_steps
from models.flow.map.view import Coverage, known_shares
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array

_STANDING_MPS = 0.35
_TRACK_STEPS = 2.0  # a track tells as much as two independent steps at the most
_NO_GROUND = -30.0
_LEAST_SEEN = 1e-3
_DIFFERENCE = 0.01  # radians, and log height
_AROUND = _DIFFERENCE * np.concatenate([np.eye(4), -np.eye(4)])
# How busy ground is that the reference did not see, against the known: tried, and a prior on it.
_BUSY_LOG = np.linspace(np.log(0.02), np.log(4.0), 9)
_BUSY_MEAN, _BUSY_SD = np.log(0.5), 1.0


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
    placed = place_steps(observations.steps, candidate, sloped=False)
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
    *,
    scored: bool = True,
) -> Likelihood:
    """How likely the walkers' places and directions in the image are, given that they are seen.

    How busy the ground is that the reference did not see is whatever suits the tracks best: a
    camera that has turned to a square must not be pulled back for it, nor sent to an empty one.
    Unless it is `scored`, the scores are nothing, and it takes a quarter of the time.
    """
    steps = walkers.steps
    placed = place_steps(steps, candidate, sloped=scored)
    slot_idx = flow.slot_of(steps.rows.time_s)
    known, by_place, by_direction = flow.look(placed.place, placed.direction, slot_idx)
    unseen, unseen_by_place = flow.look_unseen(placed.place)
    around = [candidate, *candidate + _AROUND] if scored else [candidate]
    shares, beyonds = coverage.seen_from(intrinsics, np.array(around))
    seen, beyond = np.maximum(shares[0], _LEAST_SEEN), float(beyonds[0])
    busy = _busiest(walkers, known, unseen * np.exp(flow.log_typical), seen, beyond, slot_idx)
    extra = busy * np.exp(flow.log_typical)
    density = np.exp(known) + extra * unseen
    own = np.exp(known) / density
    in_all = seen + busy * beyond
    value = np.where(placed.valid, np.log(density) + placed.log_ratio, _NO_GROUND)
    value = value - np.log(in_all)[slot_idx]
    owner, weight = steps.rows.owner_idx, walkers.weight
    values, scores = np.zeros(walkers.tracks), np.zeros((walkers.tracks, 4))
    np.add.at(values, owner, weight * value)
    if scored:
        by_place = own[:, None] * by_place + (extra / density)[:, None] * unseen_by_place
        score = (
            np.einsum("mi,mik->mk", by_place, placed.d_place)
            + (own * by_direction)[:, None] * placed.d_direction
            + placed.d_log_ratio
        )
        score[~placed.valid] = 0.0
        d_in_all = _slopes(shares[1:]) + busy * _slopes(beyonds[1:, None])
        score = score - (d_in_all / in_all[:, None])[slot_idx]
        np.add.at(scores, owner, weight[:, None] * score)
    return Likelihood(value=float(values.sum()), values=values, scores=scores)


def anchored_scores(
    walkers: Walkers,
    flow: FlowMap,
    coverage: Coverage,
    intrinsics: Intrinsics,
    candidate: Array,
    anchor: Array,
) -> Array:
    """The scores (N, 4) of people in those parts of the picture that see known ground.

    Which these are is decided at an anchor (4,), about where the candidate is, and stays so. Unlike
    the whole likelihood's, the mean of these scores is nothing at the truth whatever people do on
    ground that the reference did not see.
    """
    steps = walkers.steps
    slot_idx = flow.slot_of(steps.rows.time_s)
    unseen, _ = flow.look_unseen(place_steps(steps, anchor, sloped=False).place)
    placed = place_steps(steps, candidate)
    _, by_place, by_direction = flow.look(placed.place, placed.direction, slot_idx)
    score = (
        np.einsum("mi,mik->mk", by_place, placed.d_place)
        + by_direction[:, None] * placed.d_direction
        + placed.d_log_ratio
    )
    shares = known_shares(coverage, flow, intrinsics, candidate + _AROUND, anchor)
    score = score - _slopes(np.log(np.maximum(shares, _LEAST_SEEN)))[slot_idx]
    weight = walkers.weight * (1 - unseen) * placed.valid
    scores = np.zeros((walkers.tracks, 4))
    np.add.at(scores, steps.rows.owner_idx, weight[:, None] * score)
    return scores


def _busiest(
    walkers: Walkers,
    known: Array,
    unseen: Array,
    seen: Array,
    beyond: float,
    slot_idx: npt.NDArray[np.int64],
) -> float:
    """How busy unseen ground is for the tracks to be most likely, of those that are tried."""
    there = unseen > 0
    busy = np.exp(_BUSY_LOG)
    weight = walkers.weight[there]
    gain = np.log1p(np.outer(busy, unseen[there] / np.exp(known[there]))) @ weight
    share = np.bincount(slot_idx, walkers.weight, seen.size)
    cost = np.log(seen + np.outer(busy, np.full(seen.size, beyond))) @ share
    prior = 0.5 * ((_BUSY_LOG - _BUSY_MEAN) / _BUSY_SD) ** 2
    return float(busy[np.argmax(gain - cost - prior)])


def _slopes(around: Array) -> Array:
    """How what is known (8, S) around a candidate changes with it (S, 4)."""
    return np.asarray((around[:4] - around[4:]).T / (2 * _DIFFERENCE))
