"""How likely walks begin and end where they do, seen from a candidate, and its slopes by track."""

import math

from models.doors.door_map import DoorMap
from models.doors.moments import Moments
from models.doors.terms import Camera, Nodes, Rates, terms_of
from models.geometry.ground_flow import rotation_and_turns
from models.geometry.rotation import Array, rotation_from_angles


def door_values(moments: Moments, doors: DoorMap, candidate: Array) -> Array:
    """The log likelihood (tracks,) of beginnings and ends, seen from a candidate (4,)."""
    return _asked(moments, doors, candidate, None, scored=False)[0]


def door_likelihood(moments: Moments, doors: DoorMap, candidate: Array) -> tuple[Array, Array]:
    """The same with its slopes (tracks, 4) by tilt, roll, log height and heading."""
    return _asked(moments, doors, candidate, None, scored=True)


def anchored_door_scores(
    moments: Moments, doors: DoorMap, candidate: Array, anchor: Array
) -> Array:
    """Scores (tracks, 4) at a candidate of moments on ground that is known, seen from an anchor.

    Their mean is nothing at the truth, whatever doors there are on ground nobody knows.
    """
    return _asked(moments, doors, candidate, anchor, scored=True)[1]


def _asked(
    moments: Moments, doors: DoorMap, candidate: Array, anchor: Array | None, *, scored: bool
) -> tuple[Array, Array]:
    """Values and scores; of known ground alone, where there is an anchor (4,)."""
    rotation, turns = rotation_and_turns(*(float(candidate[number]) for number in (0, 1, 3)))
    camera = Camera(rotation=rotation, height_m=math.exp(candidate[2]))
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
        camera if anchor is None else _camera(anchor),
        anchor is not None,
        scored,
    )
    return doors.weight * values, doors.weight * scores


def _camera(candidate: Array) -> Camera:
    rotation = rotation_from_angles(candidate[0], candidate[1], candidate[3])
    return Camera(rotation=rotation, height_m=math.exp(candidate[2]))
