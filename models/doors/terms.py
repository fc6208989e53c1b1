"""What moments of walks say at a candidate by a door map: loops that add up by track.

Ours: a walk's first and last moments are likelier at doors, and its others are not. Source: Aalen
1978, log likelihood = sum of log rates at events - rates over all the time at risk.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.ground_flow import ground_flow
from models.geometry.landing import Landing, landing
from models.geometry.rotation import Array

_LAST = 1.001  # nodes: on the last one a place has no cell any more
_USUAL_EVENTS = 5.0  # as often as in the reference, with which it begins


class Nodes(NamedTuple):
    """A door map's `ratio` (X, Y, 2), `known` (X, Y), `corner` (2,) and nodes in a metre."""

    ratio: Array
    known: Array
    corner: Array
    nodes_per_m: float


class Rates(NamedTuple):
    """What is usual, `rate` (2, K) in 1/s, by log sizes from `first` on, `per_unit` of them."""

    rate: Array
    first: float
    per_unit: float


class Camera(NamedTuple):
    """`camera_from_world` (3, 3), and the height in metres."""

    rotation: Array
    height_m: float


class Cameras(NamedTuple):
    """`camera_from_world` (K, 3, 3) of each, and heights (K,) in metres."""

    rotation: Array
    height_m: Array


@compiled
def known_at(nodes: Nodes, place: Landing, height_m: float) -> float:
    """How well a place is known, 0 to 1; 0 off the grid."""
    known = nodes.known
    x = (place.x * height_m - nodes.corner[0]) * nodes.nodes_per_m
    y = (place.y * height_m - nodes.corner[1]) * nodes.nodes_per_m
    if not (place.valid and 0 <= x < known.shape[0] - _LAST and 0 <= y < known.shape[1] - _LAST):
        return 0.0
    column, row = int(x), int(y)
    x, y = x - column, y - row
    low = known[column, row] * (1 - y) + known[column, row + 1] * y
    high = known[column + 1, row] * (1 - y) + known[column + 1, row + 1] * y
    return float(low + (high - low) * x)


@compiled
def usual_rate(rates: Rates, kind: int, log_size: float) -> float:
    """What is usual of a kind, in 1/s, where people look as tall."""
    last = rates.rate.shape[1] - 1
    size = min(max((log_size - rates.first) * rates.per_unit, 0.0), float(last))
    smaller = min(int(size), last - 1)
    lower = rates.rate[kind, smaller]
    return float(lower + (rates.rate[kind, smaller + 1] - lower) * (size - smaller))


@compiled
def terms_of(
    rays: Array,
    event: npt.NDArray[np.int64],
    seconds: Array,
    log_size: Array,
    owner_idx: npt.NDArray[np.int64],
    tracks: int,
    nodes: Nodes,
    rates: Rates,
    cameras: Cameras,
    turns: Array,
    anchor: Camera,
    anchored: bool,
) -> tuple[Array, Array]:
    """Values (K, tracks) and scores (K, tracks, 4); (0, tracks, 4) if no slopes are asked for.

    The rate of a kind is the usual one times a r + b, where r is the map's ratio. If there are
    fewer events than usual, all doors are used less, a < 1; if there are more, the tracker loses
    people anywhere, b > 0.

    Args:
        rays: of M moments (M, 3).
        event: 0 where a walk begins, 1 where it ends, -1 elsewhere (M,).
        seconds: for which it could have begun, or ended (M, 2).
        log_size: of a person in pixels (M,).
        owner_idx: the track of each (M,).
        tracks: how many there are.
        nodes: the door map.
        rates: what is usual.
        cameras: at the K candidates.
        turns: of tilt and roll (K, 2, 3, 3), as of `rotation_and_turns`; (0, 2, 3, 3): no slopes.
        anchor: another camera.
        anchored: whether moments count by how well their places, seen from there, are known.
    """
    count, tried = len(rays), len(cameras.height_m)
    share, usual = np.ones(count), np.zeros((count, 2))
    events, expected = np.full(2, _USUAL_EVENTS), np.full(2, _USUAL_EVENTS)
    for number in range(count):
        if anchored:
            place = landing(rays, number, anchor.rotation)
            share[number] = known_at(nodes, place, anchor.height_m)
        for kind in range(2):
            if seconds[number, kind] > 0.0:
                rate = usual_rate(rates, kind, log_size[number])
                usual[number, kind] = share[number] * rate * seconds[number, kind]
                expected[kind] += usual[number, kind]
            if event[number] == kind:
                events[kind] += share[number]
    often = events / expected
    doors, anywhere = np.minimum(often, 1.0), np.maximum(often - 1.0, 0.0)
    columns, rows = nodes.known.shape
    ratio = nodes.ratio
    values, scores = np.zeros((tried, tracks)), np.zeros((len(turns), tracks, 4))
    for tried_idx in range(tried):
        rotation, height_m = cameras.rotation[tried_idx], cameras.height_m[tried_idx]
        for number in range(count):
            if share[number] == 0.0:
                continue
            owner = owner_idx[number]
            place = landing(rays, number, rotation)
            x = (place.x * height_m - nodes.corner[0]) * nodes.nodes_per_m
            y = (place.y * height_m - nodes.corner[1]) * nodes.nodes_per_m
            inside = place.valid and 0 <= x < columns - _LAST and 0 <= y < rows - _LAST
            column, row = (int(x), int(y)) if inside else (0, 0)
            x, y = x - column, y - row
            down_x, down_y = 0.0, 0.0  # the slopes of the value by place
            for kind in range(2):
                happens = event[number] == kind
                if not happens and usual[number, kind] == 0.0:
                    continue
                value, by_x, by_y = 1.0, 0.0, 0.0
                if inside:
                    left = ratio[column, row + 1, kind] - ratio[column, row, kind]
                    right = ratio[column + 1, row + 1, kind] - ratio[column + 1, row, kind]
                    low = ratio[column, row, kind] + left * y
                    by_x = ratio[column + 1, row, kind] + right * y - low
                    by_y = left + (right - left) * x
                    value = low + by_x * x
                counted = -doors[kind] * usual[number, kind]
                values[tried_idx, owner] += counted * value
                if happens:
                    rate = doors[kind] * value + anywhere[kind]
                    values[tried_idx, owner] += share[number] * math.log(rate)
                    counted += share[number] * doors[kind] / rate
                down_x, down_y = down_x + counted * by_x, down_y + counted * by_y
            if len(turns) and inside:
                score = scores[tried_idx, owner]
                down_x *= height_m * nodes.nodes_per_m
                down_y *= height_m * nodes.nodes_per_m
                for turn in range(2):
                    flow = ground_flow(place.x, place.y, turns[tried_idx, turn])
                    score[turn] += down_x * flow.x + down_y * flow.y
                score[2] += down_x * place.x + down_y * place.y
                # A camera that turns clockwise takes its ground along.
                score[3] += down_x * place.y - down_y * place.x
    return values, scores
