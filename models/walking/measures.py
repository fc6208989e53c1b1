"""Speeds and statures of people at a candidate pose, with their analytic derivatives.

A candidate is (tilt, roll, log height). Places are on the ground relative to the camera's foot
point, in metres, axes as the world's.

Ours: with the flow F of ground points under a small change of the pose, a step of direction u has
d log speed = u' (grad F) u. And who walks together: two tracks are one group where they are within
4 m and 37 deg of one another for 60 % of the shorter; groups are the connected components of such
pairs.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.compiled import compiled
from models.geometry.ground import ground_flow, landing, rotation_and_turns
from models.geometry.rotation import Array, Index, Mask, rotation_from_angles
from models.tracks.observations import Rows, Steps, Tops
from models.walking import config

_LEAST_STEP_M = 1e-3  # keeps the logarithm of no step at all finite
_LEAST_RATIO = 0.01  # of a person's height to the camera's


@compiled
def speeds_of_steps(
    start_rays: Array,
    end_rays: Array,
    noisy_end_rays: Array,
    seconds: Array,
    rotation: Array,
    turns: Array,
    height_m: float,
) -> tuple[Array, Array, Array, Mask, Array, Array, Array, Array]:
    """Log speeds (M,), middles (M, 2) in metres, directions (M, 2), and which are on the ground.

    After these, derivatives of the first three (M, 3), (M, 2, 3) and (M, 2, 3) by tilt, roll, log
    height, and how much the first of these change (M, 3) with a step that ends at its noisy end.
    `turns` say how a ray's direction in the world moves (T, 3, 3), for tilt and roll, or for none:
    derivatives are then by log height alone. Rays (M, 3) are in the camera frame, `rotation` is
    `camera_from_world`.
    """
    count = seconds.size
    value, valid = np.zeros(count), np.zeros(count, dtype=np.bool_)
    place, direction = np.empty((count, 2)), np.empty((count, 2))
    d_value, d_noise = np.zeros((count, 3)), np.zeros((count, 3))
    d_place, d_direction = np.zeros((count, 2, 3)), np.zeros((count, 2, 3))
    for j in range(count):
        start_x, start_y, start_valid = landing(start_rays, j, rotation)
        end_x, end_y, end_valid = landing(end_rays, j, rotation)
        x, y = (start_x + end_x) / 2, (start_y + end_y) / 2
        across_x, across_y = end_x - start_x, end_y - start_y
        length = math.sqrt(across_x * across_x + across_y * across_y)
        per_length = 1 / max(length, 1e-12)
        way_x, way_y = across_x * per_length, across_y * per_length
        place[j, 0], place[j, 1] = x * height_m, y * height_m
        direction[j, 0], direction[j, 1] = way_x, way_y
        d_place[j, 0, 2], d_place[j, 1, 2] = x * height_m, y * height_m
        if start_valid and end_valid:
            valid[j], d_value[j, 2] = True, 1.0
            square_m2 = (length * height_m) ** 2 + _LEAST_STEP_M**2
            value[j] = math.log(square_m2 / seconds[j] ** 2) / 2
        if not len(turns):
            continue
        noisy_x, noisy_y, noisy_valid = landing(noisy_end_rays, j, rotation)
        off = (noisy_y - end_y) * way_x - (noisy_x - end_x) * way_y if noisy_valid else 0.0
        turned = off / max(length / 2, 1e-12)
        toward, beside = way_x * x + way_y * y, way_x * y - way_y * x
        for number in range(len(turns)):
            turn = turns[number]
            flow = ground_flow(x, y, turn)
            d_place[j, 0, number], d_place[j, 1, number] = flow.x * height_m, flow.y * height_m
            along = way_x * turn[0, 2] + way_y * turn[1, 2]
            aside = way_x * turn[1, 2] - way_y * turn[0, 2]
            if valid[j]:
                d_value[j, number] = flow.fall + toward * along
                d_noise[j, number] = turned * (beside * along + toward * aside)
            bent_x = way_x * turn[0, 0] + way_y * turn[1, 0] + x * along
            bent_y = way_x * turn[0, 1] + way_y * turn[1, 1] + y * along
            same = bent_x * way_x + bent_y * way_y
            d_direction[j, 0, number] = bent_x - same * way_x
            d_direction[j, 1, number] = bent_y - same * way_y
    return value, place, direction, valid, d_value, d_place, d_direction, d_noise


@compiled
def heights_of_tops(
    foot_rays: Array, top_y: Array, rotation: Array, turns: Array, height_m: float
) -> tuple[Array, Array, Mask, Array, Array]:
    """Log heights of people (M,), where they stand (M, 2) in metres, and which are on the ground.

    A height is that of `geometry.upright.stature_ratio`: n / m camera heights, with
    m = down_z - y forward_z and n = (y forward - down) . (p, -1).

    After these, derivatives of the first two (M, 3) and (M, 2, 3) by tilt, roll, log height; where
    there are no turns, by log height alone. `top_y` (M,) is undistorted, normalised y.
    """
    count = top_y.size
    value, valid = np.zeros(count), np.zeros(count, dtype=np.bool_)
    place, d_value, d_place = np.zeros((count, 2)), np.zeros((count, 3)), np.zeros((count, 2, 3))
    for j in range(count):
        y = top_y[j]
        east, north, on_ground = landing(foot_rays, j, rotation)
        lean_x = y * rotation[2, 0] - rotation[1, 0]
        lean_y = y * rotation[2, 1] - rotation[1, 1]
        lean_z = y * rotation[2, 2] - rotation[1, 2]
        ratio = 1.0
        if on_ground:
            seen = (lean_x * east + lean_y * north - lean_z) / -lean_z
            if seen > _LEAST_RATIO:
                ratio, valid[j] = seen, True
                value[j] = math.log(ratio * height_m)
        place[j, 0], place[j, 1] = east * height_m, north * height_m
        for number in range(len(turns)):
            turn = turns[number]
            flow = ground_flow(east, north, turn)
            d_place[j, 0, number], d_place[j, 1, number] = flow.x * height_m, flow.y * height_m
            if valid[j]:
                bent_x = lean_x * turn[0, 0] + lean_y * turn[1, 0] + lean_z * turn[2, 0]
                bent_y = lean_x * turn[0, 1] + lean_y * turn[1, 1] + lean_z * turn[2, 1]
                bent_z = lean_x * turn[0, 2] + lean_y * turn[1, 2] + lean_z * turn[2, 2]
                top = bent_x * east + bent_y * north - bent_z + lean_x * flow.x + lean_y * flow.y
                d_value[j, number] = (top + ratio * bent_z) / -lean_z / ratio
        d_place[j, 0, 2], d_place[j, 1, 2] = place[j]
        d_value[j, 2] = 1.0 if valid[j] else 0.0
    return value, place, valid, d_value, d_place


_NO_TURNS = np.empty((0, 3, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """M logarithms at one candidate pose, where they were measured, and derivatives.

    `value` (M,) is a log speed (m/s) or log stature (m); `place` (M, 2); `direction` (M, 2) unit
    vectors of the walk, none for statures; `valid` (M,): below the horizon. `d_value` (M, 3),
    `d_place` and `d_direction` (M, 2, 3) are derivatives by tilt, roll, log height. What is not
    valid is 0. `d_direction_noise` (M, 3) is how much `d_value` changes when the direction is off
    by one standard deviation of its noise.
    """

    value: Array
    place: Array
    direction: Array | None
    valid: Mask
    d_value: Array
    d_place: Array
    d_direction: Array | None
    d_direction_noise: Array
    rows: Rows


def measure_speeds(
    steps: Steps, candidate: Array, heading_rad: float, *, sloped: bool = True
) -> Measured:
    """Log speeds of steps: the distance on the ground between both ends over the time.

    Unless it is `sloped`, the derivatives are nothing, and it takes half of the time.

    The derivative is that of a short step in the middle: uᵀ∇F u for its direction u and the flow F
    of ground points under a turn. Of the very ends it would share their noise: a step that noise
    makes longer would seem to depend more on the pose, and many tracks would agree on a wrong one.
    """
    height_m = math.exp(candidate[2])
    rotation, turns = _rotation_and_turns(candidate, heading_rad, sloped)
    value, place, direction, valid, d_value, d_place, d_direction, d_noise = speeds_of_steps(
        steps.start_rays,
        steps.end_rays,
        steps.noisy_end_rays,
        steps.seconds,
        rotation,
        turns,
        height_m,
    )
    return Measured(
        value=value,
        place=place,
        direction=direction,
        valid=valid,
        d_value=d_value,
        d_place=d_place,
        d_direction=d_direction,
        d_direction_noise=d_noise,
        rows=steps.rows,
    )


def measure_statures(
    tops: Tops, candidate: Array, heading_rad: float, *, sloped: bool = True
) -> Measured:
    """Log heights of people, from feet to the tops of their boxes.

    Unless it is `sloped`, the derivatives are nothing.
    """
    height_m = math.exp(candidate[2])
    rotation, turns = _rotation_and_turns(candidate, heading_rad, sloped)
    value, place, valid, d_value, d_place = heights_of_tops(
        tops.foot_rays, tops.top_y, rotation, turns, height_m
    )
    return Measured(
        value=value,
        place=place,
        direction=None,
        valid=valid,
        d_value=d_value,
        d_place=d_place,
        d_direction=None,
        d_direction_noise=np.zeros((value.size, 3)),
        rows=tops.rows,
    )


def _rotation_and_turns(candidate: Array, heading_rad: float, sloped: bool) -> tuple[Array, Array]:
    """The rotation (3, 3), and how rays turn with tilt and roll (2, 3, 3); (0, 3, 3) unsloped."""
    tilt_rad, roll_rad = float(candidate[0]), float(candidate[1])
    if not sloped:
        return rotation_from_angles(tilt_rad, roll_rad, heading_rad), _NO_TURNS
    return rotation_and_turns(tilt_rad, roll_rad, heading_rad)


def count_walking_groups(speeds: Measured) -> int:
    """Walking groups: people who walk side by side the same way; someone alone is one.

    People of one walking group share their pace and their pauses: twenty of them tell hardly more
    than one.
    """
    assert speeds.direction is not None
    walking = np.flatnonzero(speeds.valid & (speeds.value > np.log(config.GROUP_STANDING_MPS)))
    rows = speeds.rows
    labels = walking_groups_of(
        rows.time_s[walking],
        rows.owner_idx[walking],
        speeds.place[walking],
        speeds.direction[walking],
        rows.owners,
    )
    return int(np.unique(labels[np.unique(rows.owner_idx[walking])]).size)


def walking_groups_of(
    time_s: Array,
    owner_idx: Index,
    place: Array,
    direction: Array,
    owners: int,
    origin_s: float | None = None,
) -> Index:
    """Group (owners,) of each track by its walked steps (M,): the number of one of its tracks.

    `time_s` (M,) is the time of each step, `place` (M, 2) its place on the ground in metres,
    `direction` (M, 2) its unit vector. A track without steps is a walking group of its own.
    `origin_s` is the start of a bin of time; None means the first step. Steps of a part of a window
    need the origin of the whole window, or they get other groups.
    """
    since_s = time_s - (time_s.min(initial=np.inf) if origin_s is None else origin_s)
    time_bin = np.floor(since_s / config.GROUP_BIN_S + 1e-3).astype(np.int64)
    order = np.lexsort((time_bin, owner_idx))
    fresh = (np.diff(time_bin[order], prepend=-1) != 0) | (
        np.diff(owner_idx[order], prepend=-1) != 0
    )
    first = order[fresh]  # one step for each track and bin
    bounds = np.searchsorted(owner_idx[first], np.arange(owners + 1))
    there = np.flatnonzero(np.diff(bounds))
    by_begin = there[np.argsort(time_bin[first[bounds[there]]], kind="stable")]
    return groups_beside(time_bin[first], place[first], direction[first], bounds, by_begin)


@compiled
def groups_beside(
    time_bin: Index, place: Array, direction: Array, bounds: Index, by_begin: Index
) -> Index:
    """The first track (N,) of the group of each: those that are beside one another for long enough.

    Track n has the rows from `bounds[n]` up to `bounds[n + 1]`, one for each of its bins of time,
    which ascend; `by_begin` are the tracks that have any, by their first bins. Groups grow as they
    are found (Tarjan 1975): all the times that two of a crowd are together are too many to keep.
    """
    group = np.arange(bounds.size - 1)
    for place_one in range(by_begin.size):
        one = by_begin[place_one]
        last_bin = time_bin[bounds[one + 1] - 1]
        for place_other in range(place_one + 1, by_begin.size):
            other = by_begin[place_other]
            if time_bin[bounds[other]] > last_bin:
                break
            first, second = _root(group, one), _root(group, other)
            if first != second and _are_beside(time_bin, place, direction, bounds, one, other):
                group[max(first, second)] = min(first, second)
    for track in range(group.size):
        group[track] = _root(group, track)
    return group


@compiled
def _root(group: Index, track: int) -> int:
    while group[track] != track:
        group[track] = group[group[track]]
        track = group[track]
    return track


@compiled
def _are_beside(
    time_bin: Index, place: Array, direction: Array, bounds: Index, one: int, other: int
) -> bool:
    """True if two tracks go the same way near one another for a share of the shorter of them."""
    i, j, together = bounds[one], bounds[other], 0
    while i < bounds[one + 1] and j < bounds[other + 1]:
        if time_bin[i] < time_bin[j]:
            i += 1
        elif time_bin[j] < time_bin[i]:
            j += 1
        else:
            apart = np.hypot(place[i, 0] - place[j, 0], place[i, 1] - place[j, 1])
            same = direction[i, 0] * direction[j, 0] + direction[i, 1] * direction[j, 1]
            together += apart < config.GROUP_NEAR_M and same > config.GROUP_SAME_WAY
            i += 1
            j += 1
    shorter = min(bounds[one + 1] - bounds[one], bounds[other + 1] - bounds[other])
    long: bool = together >= config.GROUP_SHARE * shorter
    return long
