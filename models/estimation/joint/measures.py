"""Speeds and statures of people at a candidate pose, with their analytic derivatives.

A candidate is (tilt, roll, log height). Places are on the ground relative to the camera's foot
point, in metres, axes as the world's.
"""

from dataclasses import dataclass

import numpy as np

from models.estimation.joint.observations import Rows, Steps, Tops
from models.geometry.rotation import Array, Mask, rotation_and_derivatives
from models.geometry.upright import stature_ratio

_LEAST_STEP_M = 1e-3  # keeps the logarithm of no step at all finite
_LOWEST_SINE = 5e-3  # of the angle below the horizon: 0.3 deg, 200 camera heights away


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """M logarithms at one candidate pose, where they were measured, and derivatives.

    `value` (M,) is a log speed (m/s) or log stature (m); `place` (M, 2); `direction` (M, 2) unit
    vectors of the walk, none for statures; `valid` (M,): below the horizon.
    `d_value` (M, 3), `d_place` and `d_direction` (M, 2, 3) are derivatives by tilt, roll, log
    height. What is not valid is 0. `d_sway` (M, 3) is how much `d_value` changes when the
    direction is off by one standard deviation of its noise.
    """

    value: Array
    place: Array
    direction: Array | None
    valid: Mask
    d_value: Array
    d_place: Array
    d_direction: Array | None
    d_sway: Array
    rows: Rows


def measure_speeds(steps: Steps, candidate: Array, heading_rad: float) -> Measured:
    """Log speeds of steps: the distance on the ground between both ends over the time.

    The derivative is that of a short step in the middle: uᵀ∇F u for its direction u and the flow F
    of ground points under a turn. Of the very ends it would share their noise: a step that noise
    makes longer would seem to depend more on the pose, and many tracks would agree on a wrong one.
    """
    height_m = float(np.exp(candidate[2]))
    rotation, turns = _rotation_and_turns(candidate, heading_rad)
    start, start_valid = _ground(steps.start_rays, rotation)
    end, end_valid = _ground(steps.end_rays, rotation)
    valid = start_valid & end_valid
    across = end - start
    length = _norm(across)
    direction = across / np.maximum(length, 1e-12)[:, None]
    place = (start + end) / 2
    aside = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    swayed, swayed_valid = _ground(steps.swayed_rays, rotation)
    off = np.where(swayed_valid, ((swayed - end) * aside).sum(axis=1), 0.0)
    turned = off / np.maximum(length / 2, 1e-12)
    toward, beside = (direction * place).sum(axis=1), (aside * place).sum(axis=1)
    d_sway = np.zeros((len(place), 3))
    d_value = np.ones((len(place), 3))
    d_place = np.empty((len(place), 2, 3))
    d_direction = np.zeros((len(place), 2, 3))
    for number, turn in enumerate(turns):
        d_place[:, :, number], fall = _flow(place, turn)
        along = direction @ turn[:2, 2]
        d_value[:, number] = fall + toward * along
        d_sway[:, number] = turned * (beside * along + toward * (aside @ turn[:2, 2]))
        bent = direction @ turn[:2, :2] + place * along[:, None]
        across = (bent * direction).sum(axis=1)
        d_direction[:, :, number] = bent - across[:, None] * direction
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
        d_sway=np.where(valid[:, None], d_sway, 0.0),
        rows=steps.rows,
    )


def measure_statures(tops: Tops, candidate: Array, heading_rad: float) -> Measured:
    """Log heights of people, from feet to the tops of their boxes."""
    height_m = float(np.exp(candidate[2]))
    rotation, turns = _rotation_and_turns(candidate, heading_rad)
    place, valid = _ground(tops.foot_rays, rotation)
    feet = np.where(valid[:, None], tops.foot_rays, (0.0, 1e6, 1.0))
    ratio, _ = stature_ratio(rotation, feet, tops.top_y)
    valid = valid & (ratio > 0.01)
    ratio = np.where(valid, ratio, 1.0)
    # ratio = n / m, m = down_z - y forward_z, n = (y forward - down) . (p, -1)
    on_ground = _to_ground(place)
    lean = tops.top_y[:, None] * rotation[2] - rotation[1]  # (M, 3)
    lever = -lean[:, 2]
    d_value = np.ones((len(ratio), 3))
    d_place = np.empty((len(ratio), 2, 3))
    for number, turn in enumerate(turns):
        d_place[:, :, number], _ = _flow(place, turn)
        d_lean = lean @ turn
        d_top = (d_lean * on_ground).sum(1) + (lean[:, :2] * d_place[:, :, number]).sum(1)
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
        d_sway=np.zeros((len(place), 3)),
        rows=tops.rows,
    )


def _rotation_and_turns(candidate: Array, heading_rad: float) -> tuple[Array, list[Array]]:
    """The rotation (3, 3), and for tilt and roll a T (3, 3): a ray's direction w moves by w T."""
    rotation, derivatives = rotation_and_derivatives(candidate[0], candidate[1], heading_rad)
    return rotation, [rotation.T @ turned for turned in derivatives]


def _ground(rays: Array, rotation: Array) -> tuple[Array, Mask]:
    """Ground points (M, 2) in camera heights of rays (M, 3), and which are below the horizon."""
    world = rays @ rotation
    valid = -world[:, 2] > _LOWEST_SINE * _norm(world)
    down = np.where(valid, -world[:, 2], 1.0)[:, None]
    return np.where(valid[:, None], world[:, :2] / down, 0.0), valid


def _flow(ground: Array, turn: Array) -> tuple[Array, Array]:
    """How ground points (M, 2) move under a turn (M, 2), and the share (M,) that their ray falls.

    A ray's ground point is g = w_xy / -w_z; w changes by w T.
    """
    moved = _to_ground(ground) @ turn
    return moved[:, :2] + ground * moved[:, 2:], moved[:, 2]


def _to_ground(ground: Array) -> Array:
    """World directions (M, 3) to ground points (M, 2), one camera height down."""
    return np.concatenate([ground, -np.ones((len(ground), 1))], axis=1)


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))
