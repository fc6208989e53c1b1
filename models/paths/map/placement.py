"""Steps on the ground as a camera at a candidate pose sees them.

A candidate is (tilt, roll, log height, heading). Places are relative to the camera's foot point, in
metres, axes as the world's; directions are angles from +X towards +Y.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Mask, rotation_from_angles
from models.paths.compiled.step import log_ratio_of, step_on_ground
from models.tracks.observations import Steps


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
    """Where steps are on the ground and which way they go, seen from a candidate (4,)."""
    tilt, roll, log_height, heading = (float(number) for number in candidate)
    rotation = rotation_from_angles(tilt, roll, heading)
    count = len(steps.start_rays)
    placed = Placement(
        place=np.empty((count, 2)),
        direction=np.empty(count),
        length_m=np.empty(count),
        valid=np.empty(count, dtype=bool),
        log_ratio=np.empty(count),
    )
    _place(
        np.ascontiguousarray(steps.start_rays),
        np.ascontiguousarray(steps.end_rays),
        rotation,
        log_height,
        placed.place,
        placed.direction,
        placed.length_m,
        placed.valid,
        placed.log_ratio,
    )
    return placed


@compiled
def _place(
    starts: Array,
    ends: Array,
    rotation: Array,
    log_height: float,
    place: Array,
    direction: Array,
    length_m: Array,
    valid: Mask,
    log_ratio: Array,
) -> None:
    """Write where the steps between rays (M, 3) are into the last five."""
    height_m = math.exp(log_height)
    for number in range(len(starts)):
        step = step_on_ground(starts, ends, number, rotation)
        place[number, 0], place[number, 1] = step.x * height_m, step.y * height_m
        direction[number] = math.atan2(step.way_y, step.way_x)
        length_m[number] = step.length * height_m
        valid[number], log_ratio[number] = step.valid, log_ratio_of(step, log_height)
