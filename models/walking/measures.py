"""Speeds and statures of people at a candidate pose, with their analytic derivatives.

A candidate is (tilt, roll, log height). Places are on the ground relative to the camera's foot
point, in metres, axes as the world's.

Ours: with the flow F of ground points under a small change of the pose, a step of direction u has
d log speed = u' (grad F) u.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.ground import rotation_and_turns
from models.geometry.rotation import Array, Mask, rotation_from_angles
from models.tracks.observations import Rows, Steps, Tops
from models.walking.ground_loops import heights_of_tops, speeds_of_steps

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
