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
    vectors, none for statures; `valid` (M,): below the horizon. `d_value` (M, 3), `d_place` and
    `d_direction` (M, 2, 3) are derivatives by tilt, roll, log height. What is not valid is 0.
    """

    value: Array
    place: Array
    direction: Array | None
    valid: Mask
    d_value: Array
    d_place: Array
    d_direction: Array | None
    rows: Rows


def measure_speeds(steps: Steps, candidate: Array, heading_rad: float) -> Measured:
    """Log speeds of steps: the distance on the ground between both ends over the time."""
    height_m = float(np.exp(candidate[2]))
    start, d_start, ok_start = _ground(steps.start_rays, candidate, heading_rad)
    end, d_end, ok_end = _ground(steps.end_rays, candidate, heading_rad)
    valid = ok_start & ok_end
    across = np.where(valid[:, None], end - start, (1.0, 0.0)) * height_m
    length = np.sqrt((across**2).sum(axis=1) + _LEAST_STEP_M**2)
    direction = across / length[:, None]
    d_across = np.concatenate([(d_end - d_start) * height_m, across[:, :, None]], axis=-1)
    along = np.einsum("mi,mik->mk", direction, d_across)
    place = (start + end) / 2 * height_m
    d_place = np.concatenate([(d_start + d_end) / 2 * height_m, place[:, :, None]], axis=-1)
    return Measured(
        value=np.where(valid, np.log(length / steps.seconds), 0.0),
        place=place,
        direction=direction,
        valid=valid,
        d_value=np.where(valid[:, None], along / length[:, None], 0.0),
        d_place=d_place,
        d_direction=(d_across - direction[:, :, None] * along[:, None, :]) / length[:, None, None],
        rows=steps.rows,
    )


def measure_statures(tops: Tops, candidate: Array, heading_rad: float) -> Measured:
    """Log heights of people, from feet to the tops of their boxes."""
    height_m = float(np.exp(candidate[2]))
    rotation, derivatives = rotation_and_derivatives(candidate[0], candidate[1], heading_rad)
    place, d_place, valid = _ground(tops.foot_rays, candidate, heading_rad)
    feet = np.where(valid[:, None], tops.foot_rays, (0.0, 1e6, 1.0))
    ratio, _ = stature_ratio(rotation, feet, tops.top_y)
    valid = valid & (ratio > 0.01)
    ratio = np.where(valid, ratio, 1.0)
    # ratio = n / m, m = down_z - y forward_z, n = (y forward - down) . (p, -1)
    on_ground = np.concatenate([place, -np.ones((len(place), 1))], axis=1)
    lean = tops.top_y[:, None] * rotation[2] - rotation[1]  # (M, 3)
    lever = -lean[:, 2]
    d_ratio = np.empty((len(ratio), 2))
    for number, turned in enumerate(derivatives):
        d_lean = tops.top_y[:, None] * turned[2] - turned[1]
        d_top = (d_lean * on_ground).sum(1) + (lean[:, :2] * d_place[:, :, number]).sum(1)
        d_ratio[:, number] = (d_top + ratio * d_lean[:, 2]) / lever
    d_value = np.concatenate([d_ratio / ratio[:, None], np.ones((len(ratio), 1))], axis=1)
    return Measured(
        value=np.where(valid, np.log(ratio * height_m), 0.0),
        place=place * height_m,
        direction=None,
        valid=valid,
        d_value=np.where(valid[:, None], d_value, 0.0),
        d_place=np.concatenate([d_place * height_m, (place * height_m)[:, :, None]], axis=-1),
        d_direction=None,
        rows=tops.rows,
    )


def _ground(rays: Array, candidate: Array, heading_rad: float) -> tuple[Array, Array, Mask]:
    """Ground points (M, 2) in camera heights, derivatives (M, 2, 2) by tilt and roll, valid."""
    rotation, derivatives = rotation_and_derivatives(candidate[0], candidate[1], heading_rad)
    world = rays @ rotation
    valid = -world[:, 2] > _LOWEST_SINE * np.linalg.norm(world, axis=1)
    down = np.where(valid, -world[:, 2], 1.0)[:, None]
    ground = np.where(valid[:, None], world[:, :2] / down, 0.0)
    slopes = []
    for turned in derivatives:
        moved = rays @ turned
        slopes.append(moved[:, :2] / down + ground * moved[:, 2:] / down)
    return ground, np.where(valid[:, None, None], np.stack(slopes, axis=-1), 0.0), valid
