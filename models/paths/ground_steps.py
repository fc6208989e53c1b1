"""Steps on the ground: where they are, which way they go, and how that moves with a candidate.

A candidate is (tilt, roll, log height, heading). Lengths of one step are in camera heights, of many
in metres, from the camera's foot point; axes are the world's, directions from +X towards +Y.

Ours: the change of variables from the image to the ground, det J = h^2 / w_z^3 for the homography's
Jacobian J.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.compiled import compiled
from models.geometry.ground import ground_flow, landing
from models.geometry.rotation import Array, Mask, rotation_from_angles
from models.tracks.observations import Steps

_LEAST_LENGTH = 1e-12
_LEAST_RAY = 1e-9
_LEAST_FALL = 1e-6
_TURNS = 2  # of the parameters, tilt and roll: the rays' directions change by a matrix
_LOG_HEIGHT = 2


class Step(NamedTuple):
    """Its middle `x`, `y`, its way (of length 1), and its length on the ground.

    `fall` is how far the ray to its middle falls, 1 of what is not `valid`, and `seen` how long
    the step is between its rays.
    """

    x: float
    y: float
    way_x: float
    way_y: float
    length: float
    fall: float
    seen: float
    valid: bool


class Slope(NamedTuple):
    """By one parameter: of the place, the direction (radians), and the log ratio."""

    x: float
    y: float
    direction: float
    log_ratio: float


@compiled
def step_on_ground(starts: Array, ends: Array, number: int, rotation: Array) -> Step:
    """One of the steps between rays (M, 3) to both ends, by `camera_from_world` (3, 3)."""
    start, end = landing(starts, number, rotation), landing(ends, number, rotation)
    across_x, across_y = end.x - start.x, end.y - start.y
    length = max(math.sqrt(across_x * across_x + across_y * across_y), _LEAST_LENGTH)
    valid = start.valid and end.valid
    fall, seen = 1.0, 0.0
    middle_falls = 0.0
    for axis in range(3):
        apart = ends[number, axis] - starts[number, axis]
        seen += apart * apart
        middle_falls -= (starts[number, axis] + ends[number, axis]) / 2 * rotation[axis, 2]
    if valid:
        fall = max(middle_falls, _LEAST_FALL)
    return Step(
        (start.x + end.x) / 2,
        (start.y + end.y) / 2,
        across_x / length,
        across_y / length,
        length,
        fall,
        max(math.sqrt(seen), _LEAST_RAY),
        valid,
    )


@compiled
def log_ratio_of(step: Step, log_height: float) -> float:
    """The log of a density over place and direction in the image, over that on the ground.

    The image's area is that of the ground by det J = h^2 / w_z^3, its directions are those of the
    ground by det J / |J t|^2. 0 of what is not valid.
    """
    if not step.valid:
        return 0.0
    stretch = step.fall * step.fall * step.fall * (step.length / step.seen)
    return 2 * (log_height - math.log(stretch))


@compiled
def slope_of(step: Step, turns: Array, parameter: int) -> Slope:
    """The slope of a step on the ground by one of the four parameters.

    `turns` (2, 3, 3) are those of `rotation_and_turns`. The place is in camera heights of now.
    """
    if parameter < _TURNS:
        turn = turns[parameter]
        x, y = step.x, step.y
        flow = ground_flow(x, y, turn)
        along = step.way_x * turn[0, 2] + step.way_y * turn[1, 2]
        bent_x = step.way_x * turn[0, 0] + step.way_y * turn[1, 0] + x * along
        bent_y = step.way_x * turn[0, 1] + step.way_y * turn[1, 1] + y * along
        toward = step.way_x * x + step.way_y * y
        return Slope(
            flow.x,
            flow.y,
            bent_y * step.way_x - bent_x * step.way_y,
            4 * flow.fall - 2 * toward * along,
        )
    if parameter == _LOG_HEIGHT:
        return Slope(step.x, step.y, 0.0, 2.0)
    # A camera that turns clockwise takes its ground along.
    return Slope(step.y, -step.x, -1.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """M steps: `place` (M, 2), `direction` (M,), `length_m` (M,), `valid` (M,) below the horizon.

    A density over place and direction times exp(`log_ratio`) (M,) is one over the place and
    direction of a step in the image.
    """

    place: Array
    direction: Array
    length_m: Array
    valid: Mask
    log_ratio: Array


def place_steps(steps: Steps, candidate: Array) -> Placement:
    """The steps on the ground as a candidate (4,) sees them."""
    tilt, roll, log_height, heading = (float(number) for number in candidate)
    place, direction, length_m, valid, log_ratio = _placed(
        np.ascontiguousarray(steps.start_rays),
        np.ascontiguousarray(steps.end_rays),
        rotation_from_angles(tilt, roll, heading),
        log_height,
    )
    return Placement(
        place=place, direction=direction, length_m=length_m, valid=valid, log_ratio=log_ratio
    )


@compiled
def _placed(
    starts: Array, ends: Array, rotation: Array, log_height: float
) -> tuple[Array, Array, Array, Mask, Array]:
    """The fields of a placement of steps between rays (M, 3)."""
    count, height_m = len(starts), math.exp(log_height)
    place, direction, length_m = np.empty((count, 2)), np.empty(count), np.empty(count)
    valid, log_ratio = np.empty(count, dtype=np.bool_), np.empty(count)
    for number in range(count):
        step = step_on_ground(starts, ends, number, rotation)
        place[number, 0], place[number, 1] = step.x * height_m, step.y * height_m
        direction[number] = math.atan2(step.way_y, step.way_x)
        length_m[number] = step.length * height_m
        valid[number], log_ratio[number] = step.valid, log_ratio_of(step, log_height)
    return place, direction, length_m, valid, log_ratio
