"""How likely walks begin and end where they do, seen from a candidate, and its slopes by track."""

import math

import numpy as np

from models.doors.door_map import DoorMap
from models.doors.moments import Moments
from models.doors.terms import Camera, Nodes, Rates, terms_of
from models.geometry.ground_flow import rotation_and_turns
from models.geometry.rotation import Array, rotation_from_angles

_NO_TURNS = np.empty((0, 3, 3))  # no slopes are asked for


def door_values(moments: Moments, doors: DoorMap, candidates: Array) -> Array:
    """Log likelihoods (K, tracks) of beginnings and ends, seen from candidates (K, 4)."""
    return np.stack([_terms(moments, doors, _camera(each))[0] for each in candidates])


def door_likelihood(moments: Moments, doors: DoorMap, candidate: Array) -> tuple[Array, Array]:
    """The same with its slopes (tracks, 4) by tilt, roll, log height and heading."""
    return _terms(moments, doors, _camera(candidate), _turns(candidate))


def anchored_door_scores(
    moments: Moments, doors: DoorMap, candidate: Array, anchor: Array
) -> Array:
    """Scores (tracks, 4) at a candidate of moments on ground that is known, seen from an anchor.

    Their mean is nothing at the truth, whatever doors there are on ground nobody knows.
    """
    return _terms(moments, doors, _camera(candidate), _turns(candidate), _camera(anchor))[1]


def _terms(
    moments: Moments,
    doors: DoorMap,
    camera: Camera,
    turns: Array = _NO_TURNS,
    anchor: Camera | None = None,
) -> tuple[Array, Array]:
    """Values and, with the turns, scores; of known ground alone, where there is an anchor."""
    values, scores = terms_of(
        moments.rays,
        moments.event,
        moments.seconds,
        moments.log_size,
        moments.owner_idx,
        moments.owners,
        Nodes(
            ratio=doors.ratio,
            known=doors.known,
            corner=doors.corner,
            nodes_per_m=1 / float(doors.cell_m),
        ),
        Rates(
            rate=doors.rate,
            first=float(doors.log_size[0]),
            per_unit=float(1 / (doors.log_size[1] - doors.log_size[0])),
        ),
        camera,
        turns,
        camera if anchor is None else anchor,
        anchor is not None,
    )
    return doors.weight * values, doors.weight * scores


def _camera(candidate: Array) -> Camera:
    rotation = rotation_from_angles(candidate[0], candidate[1], candidate[3])
    return Camera(rotation=rotation, height_m=math.exp(candidate[2]))


def _turns(candidate: Array) -> Array:
    return rotation_and_turns(*(float(candidate[number]) for number in (0, 1, 3)))[1]
