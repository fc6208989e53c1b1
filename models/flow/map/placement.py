"""Steps on the ground as a camera at a candidate pose sees them, with derivatives.

A candidate is (tilt, roll, log height, heading). Places are relative to the camera's foot point, in
metres, axes as the world's; directions are angles from +X towards +Y.

Ours: the change of variables from the image to the ground, det J = h^2 / w_z^3.
"""

from dataclasses import dataclass

import numpy as np

from models.estimation.joint.observations import Steps
from models.geometry.ground import ground_of_rays
from models.geometry.ground_flow import ground_flow, rotation_and_turns
from models.geometry.rotation import Array, Mask
from models.geometry.vectors import aside_of, dot, norm

_LEAST_RAY = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """M steps: `place` (M, 2), `direction` (M,), `length_m` (M,), `valid` (M,) below the horizon.

    A density over place and direction times exp(`log_ratio`) (M,) is one over the place and
    direction of a step in the image. `d_...` are derivatives by the candidate: (M, 2, 4), (M, 4).
    """

    place: Array
    direction: Array
    length_m: Array
    valid: Mask
    log_ratio: Array
    d_place: Array
    d_direction: Array
    d_log_ratio: Array


def place_steps(steps: Steps, candidate: Array, *, sloped: bool = True) -> Placement:
    """Where steps are on the ground and which way they go, seen from a candidate (4,).

    Unless it is `sloped`, the derivatives are nothing, and it takes half of the time.

    The image's area is that of the ground by det J = h^2 / w_z^3 for the homography's Jacobian J,
    its directions are those of the ground by det J / |J t|^2.
    """
    tilt, roll, log_height, heading = (float(number) for number in candidate)
    height_m = float(np.exp(log_height))
    rotation, turns = rotation_and_turns(tilt, roll, heading)
    start, start_valid = ground_of_rays(steps.start_rays, rotation, beyond=0.0)
    end, end_valid = ground_of_rays(steps.end_rays, rotation, beyond=0.0)
    valid = start_valid & end_valid
    across = end - start
    length = np.maximum(norm(across), 1e-12)
    way = across / length[:, None]
    place = (start + end) / 2
    middle = (steps.start_rays + steps.end_rays) / 2
    down = np.where(valid, np.maximum(-(middle @ rotation)[:, 2], 1e-6), 1.0)
    seen = np.maximum(norm(steps.end_rays - steps.start_rays), _LEAST_RAY)
    toward, aside = dot(way, place), aside_of(way)
    count = len(place)
    d_place, d_direction, d_log_ratio = np.zeros((count, 2, 4)), *np.zeros((2, count, 4))
    for number, turn in enumerate(turns if sloped else ()):
        d_place[:, :, number], fall = ground_flow(place, turn)
        along = way @ turn[:2, 2]
        bent = way @ turn[:2, :2] + place * along[:, None]
        d_direction[:, number] = dot(bent, aside)
        d_log_ratio[:, number] = 4 * fall - 2 * toward * along
    d_place[:, :, 2] = place
    d_log_ratio[:, 2] = 2.0
    # A camera that turns clockwise takes its ground along.
    d_place[:, :, 3] = -aside_of(place)
    d_direction[:, 3] = -1.0
    log_ratio = 2 * (log_height - 3 * np.log(down) - np.log(length / seen))
    return Placement(
        place=place * height_m,
        direction=np.arctan2(way[:, 1], way[:, 0]),
        length_m=length * height_m,
        valid=valid,
        log_ratio=np.where(valid, log_ratio, 0.0),
        d_place=d_place * height_m,
        d_direction=d_direction,
        d_log_ratio=np.where(valid[:, None], d_log_ratio, 0.0),
    )
