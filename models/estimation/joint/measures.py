"""Speeds and statures of people at a candidate pose, with their analytic derivatives.

A candidate is (tilt, roll, log height). Places are on the ground relative to the camera's foot
point, in metres, axes as the world's.

Ours: with the flow F of ground points under a small change of the pose, a step of direction u has
d log speed = u' (grad F) u.
"""

from dataclasses import dataclass

import numpy as np

from models.estimation.joint.observations import Rows, Steps, Tops
from models.geometry.ground import ground_of_rays
from models.geometry.ground_flow import down_to, ground_flow, rotation_and_turns
from models.geometry.rotation import Array, Mask
from models.geometry.upright import stature_ratio
from models.geometry.vectors import aside_of, dot, norm

_LEAST_STEP_M = 1e-3  # keeps the logarithm of no step at all finite


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
    height_m = float(np.exp(candidate[2]))
    rotation, turns = rotation_and_turns(candidate[0], candidate[1], heading_rad)
    start, start_valid = ground_of_rays(steps.start_rays, rotation, beyond=0.0)
    end, end_valid = ground_of_rays(steps.end_rays, rotation, beyond=0.0)
    valid = start_valid & end_valid
    across = end - start
    length = norm(across)
    direction = across / np.maximum(length, 1e-12)[:, None]
    place = (start + end) / 2
    count = len(place)
    d_direction_noise, d_value = np.zeros((count, 3)), np.ones((count, 3))
    d_place, d_direction = np.zeros((2, count, 2, 3))
    if sloped:
        aside = aside_of(direction)
        noisy_end, noisy_valid = ground_of_rays(steps.noisy_end_rays, rotation, beyond=0.0)
        off = np.where(noisy_valid, dot(noisy_end - end, aside), 0.0)
        turned = off / np.maximum(length / 2, 1e-12)
        toward, beside = dot(direction, place), dot(aside, place)
        for number, turn in enumerate(turns):
            d_place[:, :, number], fall = ground_flow(place, turn)
            along = direction @ turn[:2, 2]
            d_value[:, number] = fall + toward * along
            d_direction_noise[:, number] = turned * (
                beside * along + toward * (aside @ turn[:2, 2])
            )
            bent = direction @ turn[:2, :2] + place * along[:, None]
            d_direction[:, :, number] = bent - dot(bent, direction)[:, None] * direction
    d_place[:, :, 2] = place
    return Measured(
        value=np.where(
            valid, np.log(np.hypot(length * height_m, _LEAST_STEP_M) / steps.seconds), 0.0
        ),
        place=place * height_m,
        direction=direction,
        valid=valid,
        d_value=np.where(valid[:, None], d_value, 0.0),
        d_place=d_place * height_m,
        d_direction=d_direction,
        d_direction_noise=np.where(valid[:, None], d_direction_noise, 0.0),
        rows=steps.rows,
    )


def measure_statures(
    tops: Tops, candidate: Array, heading_rad: float, *, sloped: bool = True
) -> Measured:
    """Log heights of people, from feet to the tops of their boxes.

    Unless it is `sloped`, the derivatives are nothing.
    """
    height_m = float(np.exp(candidate[2]))
    rotation, turns = rotation_and_turns(candidate[0], candidate[1], heading_rad)
    place, valid = ground_of_rays(tops.foot_rays, rotation, beyond=0.0)
    feet = np.where(valid[:, None], tops.foot_rays, (0.0, 1e6, 1.0))
    ratio, _ = stature_ratio(rotation, feet, tops.top_y)
    valid = valid & (ratio > 0.01)
    ratio = np.where(valid, ratio, 1.0)
    # ratio = n / m, m = down_z - y forward_z, n = (y forward - down) . (p, -1)
    on_ground = down_to(place)
    lean = tops.top_y[:, None] * rotation[2] - rotation[1]  # (M, 3)
    lever = -lean[:, 2]
    d_value = np.ones((len(ratio), 3))
    d_place = np.zeros((len(ratio), 2, 3))
    for number, turn in enumerate(turns if sloped else ()):
        d_place[:, :, number], _ = ground_flow(place, turn)
        d_lean = lean @ turn
        d_top = dot(d_lean, on_ground) + dot(lean[:, :2], d_place[:, :, number])
        d_value[:, number] = (d_top + ratio * d_lean[:, 2]) / lever / ratio
    d_place[:, :, 2] = place
    return Measured(
        value=np.where(valid, np.log(ratio * height_m), 0.0),
        place=place * height_m,
        direction=None,
        valid=valid,
        d_value=np.where(valid[:, None], d_value, 0.0),
        d_place=d_place * height_m,
        d_direction=None,
        d_direction_noise=np.zeros((len(place), 3)),
        rows=tops.rows,
    )
