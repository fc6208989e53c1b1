"""How likely walks begin and end where they do, seen from a candidate, and its slopes by track."""

import math

import numpy as np

from models.doors.door_map import DoorMap
from models.doors.terms import Camera, Cameras, Nodes, Rates, terms_of
from models.geometry.ground_flow import rotation_and_turns
from models.geometry.rotation import Array, rotation_from_angles
from models.tracks.exposure import Moments

_NO_TURNS = np.empty((0, 2, 3, 3))  # no slopes are asked for
_NOWHERE = Camera(rotation=np.eye(3), height_m=1.0)


def door_values(moments: Moments, doors: DoorMap, candidates: Array) -> Array:
    """Log likelihoods (K, tracks) of beginnings and ends, seen from candidates (K, 4)."""
    return _terms(moments, doors, candidates, _NO_TURNS)[0]


def door_likelihood(moments: Moments, doors: DoorMap, candidate: Array) -> tuple[Array, Array]:
    """The same (tracks,) of one (4,), with slopes (tracks, 4) by the four parameters."""
    values, scores = _terms(moments, doors, candidate[None], _turns(candidate[None]))
    return values[0], scores[0]


def anchored_door_scores(
    moments: Moments, doors: DoorMap, candidates: Array, anchor: Array
) -> Array:
    """Scores (..., tracks, 4) at candidates (..., 4) of moments on ground that is known.

    Seen from an anchor (4,): their mean is nothing at the truth, whatever doors there are on ground
    nobody knows.
    """
    flat = candidates.reshape(-1, 4)
    rotation = rotation_from_angles(anchor[0], anchor[1], anchor[3])
    there = Camera(rotation=rotation, height_m=math.exp(anchor[2]))
    scores = _terms(moments, doors, flat, _turns(flat), there)[1]
    return scores.reshape(*candidates.shape[:-1], moments.owners, 4)


def _terms(
    moments: Moments, doors: DoorMap, candidates: Array, turns: Array, anchor: Camera | None = None
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
        Cameras(
            rotation=rotation_from_angles(candidates[:, 0], candidates[:, 1], candidates[:, 3]),
            height_m=np.exp(candidates[:, 2]),
        ),
        turns,
        _NOWHERE if anchor is None else anchor,
        anchor is not None,
    )
    return doors.weight * values, doors.weight * scores


def _turns(candidates: Array) -> Array:
    """Those of tilt and roll (K, 2, 3, 3)."""
    angles = candidates[:, [0, 1, 3]].tolist()
    return np.array([rotation_and_turns(*each)[1] for each in angles])
