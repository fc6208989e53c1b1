"""The log densities of steps at a candidate, in loops that add up by track.

`rotation` (3, 3) is `camera_from_world`, `turns` (2, 3, 3) are those of `rotation_and_turns`.
"""

import math
from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.geometry.ground import landing
from models.geometry.rotation import Array, Index, Mask
from models.paths import config
from models.paths.density_map import Grid, LogDensity, log_density_at, unseen_at
from models.paths.ground_steps import Slope, log_ratio_of, slope_of, step_on_ground


class StepRows(NamedTuple):
    """M steps between rays (M, 3) to both ends: weights, tracks, parts of the day (M,)."""

    starts: Array
    ends: Array
    weight: Array
    owner_idx: Index
    slot_idx: Index


class Busyness(NamedTuple):
    """Levels (L,) of how busy unseen ground may be against the seen, and their `log_prior` (L,).

    `typical` is the density there, were it as busy.
    """

    levels: Array
    log_prior: Array
    typical: float


class StepLogDensities(NamedTuple):
    """The log density of each step, however busy unseen ground is.

    `seen` (M,) is that of the ground that the reference saw, `unseen` (M,) the part that it did
    not, and the log ratio (M,) is of what is `valid`. `slopes` (M, 3, 4) are by the candidate of
    the three; (0, 3, 4) without slopes.
    """

    seen: Array
    unseen: Array
    log_ratio: Array
    valid: Mask
    slopes: Array


@compiled
def slope_on_map(found: LogDensity, slope: Slope, height_m: float) -> float:
    """The slope of a step's log density on seen ground as the step moves with a parameter."""
    return (
        height_m * (found.by_x * slope.x + found.by_y * slope.y)
        + found.by_direction * slope.direction
    )


@compiled
def step_log_densities(
    steps: StepRows, grid: Grid, rotation: Array, turns: Array, log_height: float
) -> StepLogDensities:
    """The log densities at a candidate; without slopes where there are no turns (0, 3, 3)."""
    count, sloped = len(steps.starts), len(turns) > 0
    seen, unseen, log_ratio = np.empty(count), np.empty(count), np.empty(count)
    valid = np.empty(count, dtype=np.bool_)
    slopes = np.empty((count if sloped else 0, 3, 4))
    height_m = math.exp(log_height)
    for number in range(count):
        step = step_on_ground(steps.starts, steps.ends, number, rotation)
        x_m, y_m = step.x * height_m, step.y * height_m
        direction = math.atan2(step.way_y, step.way_x)
        found = log_density_at(grid, steps.slot_idx[number], x_m, y_m, direction)
        hidden = unseen_at(grid, x_m, y_m)
        seen[number], unseen[number] = found.value, hidden.value
        log_ratio[number], valid[number] = log_ratio_of(step, log_height), step.valid
        if sloped:
            for parameter in range(4):
                slope = slope_of(step, turns, parameter)
                slopes[number, 0, parameter] = slope_on_map(found, slope, height_m)
                slopes[number, 1, parameter] = height_m * (
                    hidden.by_x * slope.x + hidden.by_y * slope.y
                )
                slopes[number, 2, parameter] = slope.log_ratio
    return StepLogDensities(seen, unseen, log_ratio, valid, slopes)


@compiled
def likeliest_busyness(
    densities: StepLogDensities, steps: StepRows, busyness: Busyness, seen: Array, beyond: float
) -> float:
    """The level at which the tracks are most likely.

    `seen` (S,) is the share of people on seen ground whom the camera sees, `beyond` of those on
    unseen ground, were it as busy.
    """
    likely, share = busyness.log_prior.copy(), np.zeros(seen.size)
    for number in range(steps.weight.size):
        weight = steps.weight[number]
        share[steps.slot_idx[number]] += weight
        if densities.unseen[number] > 0:
            ratio = densities.unseen[number] * busyness.typical / math.exp(densities.seen[number])
            for level in range(likely.size):
                likely[level] += weight * math.log1p(busyness.levels[level] * ratio)
    for level in range(likely.size):
        for slot in range(seen.size):
            likely[level] -= share[slot] * math.log(seen[slot] + busyness.levels[level] * beyond)
    return float(busyness.levels[np.argmax(likely)])


@compiled
def likelihood_of_tracks(
    densities: StepLogDensities,
    steps: StepRows,
    extra: float,
    log_share: Array,
    d_log_share: Array,
    tracks: int,
) -> tuple[Array, Array]:
    """Values (tracks,) and scores (tracks, 4); scores are 0 where there are no slopes.

    `extra` is how dense people are on unseen ground, `log_share` (S,) of all people those that the
    camera sees, with derivatives (S, 4) by the candidate.
    """
    values, scores = np.zeros(tracks), np.zeros((tracks, 4))
    sloped = len(densities.slopes) > 0
    for number in range(steps.weight.size):
        owner, slot, weight = steps.owner_idx[number], steps.slot_idx[number], steps.weight[number]
        own, valid = math.exp(densities.seen[number]), densities.valid[number]
        density = own + extra * densities.unseen[number]
        value = config.NO_GROUND
        if valid:
            value = math.log(density) + densities.log_ratio[number]
        values[owner] += weight * (value - log_share[slot])
        if sloped:
            for parameter in range(4):
                score = -d_log_share[slot, parameter]
                if valid:
                    score += (
                        own / density * densities.slopes[number, 0, parameter]
                        + extra / density * densities.slopes[number, 1, parameter]
                        + densities.slopes[number, 2, parameter]
                    )
                scores[owner, parameter] += weight * score
    return values, scores


@compiled
def values_of_tracks(
    steps: StepRows,
    grid: Grid,
    rotations: Array,
    log_heights: Array,
    busyness: Busyness,
    seen: Array,
    beyond: Array,
    levels: Array,
    tracks: int,
) -> tuple[Array, Array]:
    """Values (K, tracks) at K candidates, by `rotations` (K, 3, 3) and `log_heights` (K,).

    `seen` (K, S) and `beyond` (K,) are each candidate's, as of `likeliest_busyness`. `levels` (K,)
    are the levels of busyness; NaN means the likeliest one.

    Returns:
        Values (K, tracks) and the levels (K,) by which they were made.
    """
    values, used = np.empty((len(rotations), tracks)), levels.copy()
    no_turns, no_slopes = np.empty((0, 3, 3)), np.zeros((seen.shape[1], 4))
    for candidate in range(len(rotations)):
        rotation, log_height = rotations[candidate], log_heights[candidate]
        densities = step_log_densities(steps, grid, rotation, no_turns, log_height)
        own, away = seen[candidate], beyond[candidate]
        if math.isnan(used[candidate]):
            used[candidate] = likeliest_busyness(densities, steps, busyness, own, away)
        busy = used[candidate]
        log_share, extra = np.log(own + busy * away), busy * busyness.typical
        values[candidate], _ = likelihood_of_tracks(
            densities, steps, extra, log_share, no_slopes, tracks
        )
    return values, used


@compiled
def anchored_scores_of_tracks(
    steps: StepRows,
    grid: Grid,
    rotations: Array,
    turns: Array,
    heights_m: Array,
    anchor: Array,
    anchor_height_m: float,
    d_log_shares: Array,
    tracks: int,
) -> Array:
    """Scores (K, tracks, 4) of steps as far as they are on seen ground, by an anchor (3, 3).

    At K candidates, by `rotations` (K, 3, 3), `turns` (K, 2, 3, 3), `heights_m` (K,) and
    `d_log_shares` (K, S, 4).
    """
    scores, counted = np.zeros((len(rotations), tracks, 4)), np.empty(steps.weight.size)
    for number in range(counted.size):
        start, end = landing(steps.starts, number, anchor), landing(steps.ends, number, anchor)
        x_m, y_m = (start.x + end.x) / 2 * anchor_height_m, (start.y + end.y) / 2 * anchor_height_m
        counted[number] = steps.weight[number] * (1 - unseen_at(grid, x_m, y_m).value)
    for candidate in range(len(rotations)):
        rotation, height_m = rotations[candidate], heights_m[candidate]
        for number in range(counted.size):
            step = step_on_ground(steps.starts, steps.ends, number, rotation)
            if not step.valid:
                continue
            owner, slot = steps.owner_idx[number], steps.slot_idx[number]
            direction = math.atan2(step.way_y, step.way_x)
            found = log_density_at(grid, slot, step.x * height_m, step.y * height_m, direction)
            for parameter in range(4):
                slope = slope_of(step, turns[candidate], parameter)
                score = slope_on_map(found, slope, height_m) + slope.log_ratio
                score -= d_log_shares[candidate, slot, parameter]
                scores[candidate, owner, parameter] += counted[number] * score
    return scores
