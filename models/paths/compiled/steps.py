"""What steps say at a candidate: loops over M steps that add up by track.

The steps run between rays (M, 3) to both ends; `rotation` (3, 3) is `camera_from_world`, `turns`
(2, 3, 3) are those of `rotation_and_turns`, `slot_idx` (M,) is the part of the day.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.landing import landing
from models.geometry.rotation import Array, Mask
from models.paths.compiled.place import Grid, look_at, unseen_at
from models.paths.compiled.step import log_ratio_of, slope_of, step_on_ground

_NO_GROUND = -30.0
Index = npt.NDArray[np.int64]


class Told(NamedTuple):
    """What each step says before it is known how busy unseen ground is.

    The log density `known` (M,) of known ground, which part is `unseen` (M,), and the log ratio
    (M,) of what is `valid`. `slopes` (M, 3, 4) are by the candidate of the three; (0, 3, 4)
    where no slopes were asked for.
    """

    known: Array
    unseen: Array
    log_ratio: Array
    valid: Mask
    slopes: Array


@compiled
def tell(
    starts: Array,
    ends: Array,
    slot_idx: Index,
    grid: Grid,
    rotation: Array,
    turns: Array,
    log_height: float,
) -> Told:
    """What each step says at a candidate; without slopes where there are no turns (0, 3, 3)."""
    count, scored = len(starts), len(turns) > 0
    known, unseen, log_ratio = np.empty(count), np.empty(count), np.empty(count)
    valid = np.empty(count, dtype=np.bool_)
    slopes = np.empty((count if scored else 0, 3, 4))
    height_m = math.exp(log_height)
    for number in range(count):
        step = step_on_ground(starts, ends, number, rotation)
        x_m, y_m = step.x * height_m, step.y * height_m
        direction = math.atan2(step.way_y, step.way_x)
        look = look_at(grid, slot_idx[number], x_m, y_m, direction)
        hidden = unseen_at(grid, x_m, y_m)
        known[number], unseen[number] = look.value, hidden.value
        log_ratio[number], valid[number] = log_ratio_of(step, log_height), step.valid
        if scored:
            for parameter in range(4):
                slope = slope_of(step, turns, parameter)
                slopes[number, 0, parameter] = (
                    height_m * (look.by_x * slope.x + look.by_y * slope.y)
                    + look.by_direction * slope.direction
                )
                slopes[number, 1, parameter] = height_m * (
                    hidden.by_x * slope.x + hidden.by_y * slope.y
                )
                slopes[number, 2, parameter] = slope.log_ratio
    return Told(known, unseen, log_ratio, valid, slopes)


@compiled
def busiest(
    told: Told,
    weight: Array,
    slot_idx: Index,
    typical: float,
    seen: Array,
    beyond: float,
    busy: Array,
    log_prior: Array,
) -> float:
    """How busy unseen ground is for the tracks to be most likely, of what is tried (L,).

    Args:
        told: what the steps say.
        weight: of each step (M,).
        slot_idx: the part of the day (M,).
        typical: the density on unseen ground, were it as busy as the known.
        seen: the share (S,) of people on known ground whom the camera sees.
        beyond: the share of those on unseen ground, were it as busy.
        busy: what is tried (L,), against the known ground.
        log_prior: of what is tried (L,).
    """
    likely, share = log_prior.copy(), np.zeros(seen.size)
    for number in range(weight.size):
        share[slot_idx[number]] += weight[number]
        if told.unseen[number] > 0:
            ratio = told.unseen[number] * typical / math.exp(told.known[number])
            for level in range(busy.size):
                likely[level] += weight[number] * math.log1p(busy[level] * ratio)
    for level in range(busy.size):
        for slot in range(seen.size):
            likely[level] -= share[slot] * math.log(seen[slot] + busy[level] * beyond)
    return float(busy[np.argmax(likely)])


@compiled
def likelihood_of_tracks(
    told: Told,
    weight: Array,
    owner_idx: Index,
    slot_idx: Index,
    extra: float,
    log_share: Array,
    d_log_share: Array,
    tracks: int,
) -> tuple[Array, Array]:
    """Values (tracks,) and scores (tracks, 4), nothing of what was not told with slopes.

    Args:
        told: what the steps say.
        weight: of each step (M,).
        owner_idx: the track of each step (M,).
        slot_idx: the part of the day (M,).
        extra: how dense people are on unseen ground.
        log_share: of all people, those that the camera sees (S,).
        d_log_share: its derivatives by the candidate (S, 4).
        tracks: how many there are.
    """
    values, scores = np.zeros(tracks), np.zeros((tracks, 4))
    scored = len(told.slopes) > 0
    for number in range(weight.size):
        owner, slot = owner_idx[number], slot_idx[number]
        density = math.exp(told.known[number])
        own = density
        density += extra * told.unseen[number]
        value = _NO_GROUND
        if told.valid[number]:
            value = math.log(density) + told.log_ratio[number]
        values[owner] += weight[number] * (value - log_share[slot])
        if scored:
            for parameter in range(4):
                score = -d_log_share[slot, parameter]
                if told.valid[number]:
                    score += (
                        own / density * told.slopes[number, 0, parameter]
                        + extra / density * told.slopes[number, 1, parameter]
                        + told.slopes[number, 2, parameter]
                    )
                scores[owner, parameter] += weight[number] * score
    return values, scores


@compiled
def values_of_tracks(
    starts: Array,
    ends: Array,
    weight: Array,
    owner_idx: Index,
    slot_idx: Index,
    grid: Grid,
    rotations: Array,
    log_heights: Array,
    typical: float,
    seen: Array,
    beyond: Array,
    busy: Array,
    log_prior: Array,
    tracks: int,
) -> Array:
    """Values (K, tracks) at K candidates, by `rotations` (K, 3, 3) and `log_heights` (K,).

    `seen` (K, S) and `beyond` (K,) are each candidate's; all else is as in `busiest` and
    `likelihood_of_tracks`.
    """
    values = np.empty((len(rotations), tracks))
    no_turns, no_slopes = np.empty((0, 3, 3)), np.zeros((seen.shape[1], 4))
    for candidate in range(len(rotations)):
        rotation, log_height = rotations[candidate], log_heights[candidate]
        told = tell(starts, ends, slot_idx, grid, rotation, no_turns, log_height)
        own, away = seen[candidate], beyond[candidate]
        as_busy = busiest(told, weight, slot_idx, typical, own, away, busy, log_prior)
        log_share = np.log(own + as_busy * away)
        values[candidate], _ = likelihood_of_tracks(
            told, weight, owner_idx, slot_idx, as_busy * typical, log_share, no_slopes, tracks
        )
    return values


@compiled
def known_scores_of_tracks(
    starts: Array,
    ends: Array,
    weight: Array,
    owner_idx: Index,
    slot_idx: Index,
    grid: Grid,
    rotations: Array,
    turns: Array,
    heights_m: Array,
    anchor: Array,
    anchor_height_m: float,
    d_log_shares: Array,
    tracks: int,
) -> Array:
    """Scores (K, tracks, 4) of steps as far as they are on known ground, seen from an anchor.

    At K candidates, by `rotations` (K, 3, 3), `turns` (K, 2, 3, 3), `heights_m` (K,) and
    `d_log_shares` (K, S, 4). `weight`, `owner_idx` and each of the last are as in
    `likelihood_of_tracks`; the anchor's rotation is (3, 3).
    """
    scores, counted = np.zeros((len(rotations), tracks, 4)), np.empty(weight.size)
    for number in range(weight.size):
        start, end = landing(starts, number, anchor), landing(ends, number, anchor)
        x_m, y_m = (start.x + end.x) / 2 * anchor_height_m, (start.y + end.y) / 2 * anchor_height_m
        counted[number] = weight[number] * (1 - unseen_at(grid, x_m, y_m).value)
    for candidate in range(len(rotations)):
        rotation, height_m = rotations[candidate], heights_m[candidate]
        turned, d_log_share = turns[candidate], d_log_shares[candidate]
        for number in range(weight.size):
            step = step_on_ground(starts, ends, number, rotation)
            if not step.valid:
                continue
            owner, slot = owner_idx[number], slot_idx[number]
            direction = math.atan2(step.way_y, step.way_x)
            look = look_at(grid, slot, step.x * height_m, step.y * height_m, direction)
            for parameter in range(4):
                slope = slope_of(step, turned, parameter)
                score = (
                    height_m * (look.by_x * slope.x + look.by_y * slope.y)
                    + look.by_direction * slope.direction
                    + slope.log_ratio
                )
                score -= d_log_share[slot, parameter]
                scores[candidate, owner, parameter] += counted[number] * score
    return scores
