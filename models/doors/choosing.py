"""Whether there are doors, and how fine a map of them: what predicts people who are left out.

Source: Duin 1976, the width of a kernel by the likelihood of who was left out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.doors.door_map import (
    Counts,
    DoorGrain,
    DoorMap,
    Nodes,
    around,
    count_at,
    door_map_of,
)
from models.doors.likelihood import door_values
from models.geometry.ground import ground_of_rays
from models.geometry.rotation import Array, rotation_from_angles
from models.tracks.exposure import Moments

_SMOOTH_M = (0.3, 0.5, 0.8, 1.3)
_CLEAR = 3.0  # standard errors by which doors must predict better than none


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Moments to learn of, with what each track counts for, and others to predict.

    `group_idx` (tracks,) is the walking group of each of the others, `nodes` are the map's.
    """

    known: Moments
    weights: Array
    asked: Moments
    group_idx: npt.NDArray[np.int64]
    nodes: Nodes


def doors_of(
    moments: Moments, weights: Array, at: Array, nodes: Nodes, grain: DoorGrain
) -> DoorMap:
    """The door map of moments seen from a known pose (4,), each track counted by its weight."""
    (counts,) = around(_counts(moments, weights, at, nodes), nodes, (grain.smooth_m,))
    return door_map_of(counts, nodes, grain)


def best_door_grain(parts: Sequence[Part], at: Array) -> DoorGrain | None:
    """The grain that predicts best where people begin and end; None where none clearly does.

    Args:
        parts: of the people, each with others to learn of.
        at: the known pose (4,).
    """
    if not all(part.known.events and part.asked.events for part in parts):
        return None
    gains: dict[DoorGrain, list[Array]] = {}
    for part in parts:
        counted = _counts(part.known, part.weights, at, part.nodes)
        nowhere = _nowhere(part, counted, at)
        smoothed = around(counted, part.nodes, _SMOOTH_M)
        for smooth_m, counts in zip(_SMOOTH_M, smoothed, strict=True):
            for alike in (False, True):
                grain = DoorGrain(smooth_m=smooth_m, alike=alike)
                doors = door_map_of(counts, part.nodes, grain)
                gains.setdefault(grain, []).append(_gains(part, doors, at, nowhere))
    every = {grain: np.concatenate(found) for grain, found in gains.items()}
    best = max(every, key=lambda grain: float(every[grain].mean()))
    gained = every[best]
    return best if gained.mean() > _CLEAR * gained.std() / math.sqrt(gained.size) else None


def _counts(moments: Moments, weights: Array, at: Array, nodes: Nodes) -> Counts:
    rotation = rotation_from_angles(at[0], at[1], at[3])
    place, on_ground = ground_of_rays(moments.rays, rotation, beyond=0.0)
    weight = weights[moments.owner_idx]
    return count_at(moments, place * math.exp(at[2]), on_ground, weight, nodes)


def _nowhere(part: Part, counts: Counts, at: Array) -> Array:
    """What there would be to say (tracks,) of walks if people began and ended them anywhere."""
    doors = door_map_of(counts, part.nodes, DoorGrain(smooth_m=_SMOOTH_M[0], alike=False))
    anywhere = replace(doors, ratio=np.ones_like(doors.ratio))
    return np.asarray(door_values(part.asked, anywhere, at[None])[0])


def _gains(part: Part, doors: DoorMap, at: Array, nowhere: Array) -> Array:
    """How much (P,) likelier each walking group's people begin and end there than without doors."""
    gains = door_values(part.asked, doors, at[None])[0] - nowhere
    owners = np.unique(part.asked.owner_idx)
    _, group = np.unique(part.group_idx[owners], return_inverse=True)
    return np.asarray(np.bincount(group, gains[owners]) / np.bincount(group))
