"""What a person marks in a picture to tell where its camera looks: each a factor on the pose.

A candidate is (tilt, roll, log height, heading, x, y), angles in radians, lengths in metres. Marks
are off by some pixels, which each factor turns into its own standard deviation; Gauss-Newton joins
them with a Gaussian of what is known otherwise.

Source: Triggs, McLauchlan, Hartley and Fitzgibbon 2000, Bundle Adjustment, for factors weighed by
their propagated noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, norm, rotation_from_angles

_NOISE_PX = 3.0  # of a mark, at a width of 1920
_LEAN_RAD, _TAPE_LOG = math.radians(0.3), 0.01  # of walls and posts, tapes
_ROUNDS, _CONVERGED, _STEP, _LONGEST = 30, 1e-7, 1e-5, 0.3
_MOST_TILT_RAD = math.radians(89)
_LOWEST = 1e-3  # sine of an angle below the horizon
_FREE_SD = np.array([math.pi, 1e3, 1e3])  # of heading, x and y, once a map tells them
_PLANE = 3  # tilt, roll, log height


class HintKind(StrEnum):
    """What a mark is of."""

    HORIZON = "horizon"
    VERTICAL = "vertical"
    LENGTH = "length"
    MAP_POINT = "map_point"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hint:
    """A mark in the picture.

    `points` (N, 2) are pixels: two on the horizon; foot and top of a vertical; both ends of a
    length on the ground; one point of a map. `length_m` is of the length, or of a vertical where it
    is known; `place_m` x and y on the map, each known to `place_sd_m`.
    """

    kind: HintKind
    points: Array
    length_m: float | None = None
    place_m: tuple[float, float] | None = None
    place_sd_m: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class HintedPose:
    """The pose (6,) with its covariance (6, 6), as of a candidate, and how far each hint is off.

    `residual_sd` are the residuals of the hints in their own standard deviations; a mark with
    much more than 2 is wrong.
    """

    values: Array
    covariance: Array
    residual_sd: tuple[float, ...]

    @property
    def pose(self) -> CameraPose:
        """As a value."""
        tilt, roll, log_height, heading, x_m, y_m = (float(value) for value in self.values)
        return CameraPose(
            height_m=math.exp(log_height), tilt_rad=tilt, roll_rad=roll,
            heading_rad=math.remainder(heading, 2 * math.pi), x_m=x_m, y_m=y_m,
        )  # fmt: skip


def with_hints(
    mean: Array, covariance: Array, hints: Sequence[Hint], intrinsics: Intrinsics
) -> HintedPose:
    """A Gaussian (3,), (3, 3) of tilt, roll and log height, together with marks.

    Heading and position stay 0 unless two points of a map tell them.

    Raises:
        DegenerateGeometryError: a mark of the ground is above the horizon by the pose that is
            found, or both ends of a mark are at one point.
    """
    mapped = [hint for hint in hints if hint.kind == HintKind.MAP_POINT]
    free = _PLANE + (_PLANE if len(mapped) > 1 else 0)
    used = [hint for hint in hints if free > _PLANE or hint.kind != HintKind.MAP_POINT]
    middle = np.concatenate([mean, np.zeros(_PLANE)])
    precision = np.zeros((2 * _PLANE, 2 * _PLANE))
    precision[:_PLANE, :_PLANE] = np.linalg.inv(covariance)
    precision[_PLANE:, _PLANE:] = np.diag(_FREE_SD**-2.0)
    candidate = middle.copy()
    if free > _PLANE:
        candidate = _turned_to_map(candidate, mapped, intrinsics)
        middle[_PLANE:] = candidate[_PLANE:]
    information = precision
    for _ in range(_ROUNDS):
        information = precision.copy()
        gradient = precision @ (candidate - middle)
        for hint in used:
            residual, slopes = _whitened(hint, candidate, intrinsics)
            information += slopes.T @ slopes
            gradient += slopes.T @ residual
        move = np.zeros(2 * _PLANE)
        move[:free] = -np.linalg.solve(information[:free, :free], gradient[:free])
        longest = max(float(np.abs(move[:_PLANE]).max()), 1e-12)
        candidate = candidate + move * min(1.0, _LONGEST / longest)
        if np.abs(move).max() < _CONVERGED:
            break
    if abs(candidate[0]) > _MOST_TILT_RAD:
        raise DegenerateGeometryError("hints: no pose that a camera can have fits them")
    for hint in used:
        _check_on_ground(hint, candidate, intrinsics)
    found = np.zeros((2 * _PLANE, 2 * _PLANE))
    found[:free, :free] = np.linalg.inv(information[:free, :free])
    off = [
        float(norm(_whitened(hint, candidate, intrinsics)[0])) if hint in used else 0.0
        for hint in hints
    ]
    return HintedPose(values=candidate, covariance=found, residual_sd=tuple(off))


def _whitened(hint: Hint, candidate: Array, lens: Intrinsics) -> tuple[Array, Array]:
    """Residuals (M,) over their noise, and their derivatives (M, 6) by the candidate."""
    at = _residual(hint, candidate, hint.points, lens)
    by_pixel = []
    for place in np.ndindex(hint.points.shape):
        moved = hint.points.copy()
        moved[place] += 0.5
        by_pixel.append((_residual(hint, candidate, moved, lens) - at) / 0.5)
    noise = np.array(by_pixel).T * (_NOISE_PX * lens.width / 1920)
    covariance = noise @ noise.T + np.eye(at.size) * _other_sd(hint) ** 2
    root = np.linalg.cholesky(covariance)
    slopes = np.empty((at.size, candidate.size))
    for number in range(candidate.size):
        beside = candidate.copy()
        beside[number] += _STEP
        slopes[:, number] = (_residual(hint, beside, hint.points, lens) - at) / _STEP
    return np.linalg.solve(root, at), np.linalg.solve(root, slopes)


def _other_sd(hint: Hint) -> float:
    """What marks of a kind are off by beside their pixels."""
    return {
        HintKind.HORIZON: 1e-4, HintKind.VERTICAL: _LEAN_RAD,
        HintKind.LENGTH: _TAPE_LOG, HintKind.MAP_POINT: hint.place_sd_m,
    }[hint.kind]  # fmt: skip


def _residual(hint: Hint, candidate: Array, points: Array, lens: Intrinsics) -> Array:
    rays, known = lens.rays(points)
    if not known.all():
        raise DegenerateGeometryError("points: no ray leads to one of them")
    world = rays @ rotation_from_angles(*candidate[[0, 1, 3]])
    if hint.kind == HintKind.HORIZON:
        return np.asarray(world[:, 2] / norm(world))
    if hint.kind == HintKind.VERTICAL:
        normal = np.cross(world[0], world[1])
        length = float(norm(normal))
        if length < 1e-9:
            raise DegenerateGeometryError("points: foot and top are the same point")
        leans = normal[2] / length
        if hint.length_m is None:
            return np.array([leans])
        return np.array([leans, math.log(_tall_m(world, candidate) / hint.length_m)])
    ground = _landed(world, candidate)
    if hint.kind == HintKind.MAP_POINT:
        assert hint.place_m is not None
        return np.asarray(ground[0] + candidate[4:] - hint.place_m)
    assert hint.length_m is not None
    length = float(norm(ground[0] - ground[1]))
    if length < 1e-9:
        raise DegenerateGeometryError("points: both ends are the same point")
    return np.array([math.log(length / hint.length_m)])


def _landed(world: Array, candidate: Array) -> Array:
    """Ground points (N, 2) of directions (N, 3) from the camera, relative to its foot, metres.

    On the way to a pose some may seem to be above the horizon: they are taken to be far away.
    """
    down = np.maximum(-world[:, 2], _LOWEST * norm(world))
    return np.asarray(world[:, :2] * (math.exp(candidate[2]) / down[:, None]))


def _check_on_ground(hint: Hint, candidate: Array, lens: Intrinsics) -> None:
    feet = {HintKind.HORIZON: 0, HintKind.VERTICAL: 1 if hint.length_m else 0}.get(hint.kind, 2)
    rays, _ = lens.rays(hint.points[:feet])
    world = rays @ rotation_from_angles(*candidate[[0, 1, 3]])
    if (world[:, 2] > -_LOWEST * norm(world)).any():
        raise DegenerateGeometryError(f"{hint.kind}: one of its points is not on the ground")


def _tall_m(world: Array, candidate: Array) -> float:
    """How tall a vertical is whose foot is on the ground."""
    (foot,) = _landed(world[:1], candidate)
    steepness = world[1, 2] / max(float(norm(world[1, :2])), 1e-9)
    tall = math.exp(candidate[2]) + float(steepness * norm(foot))
    return max(tall, 1e-3)


def _turned_to_map(candidate: Array, mapped: Sequence[Hint], lens: Intrinsics) -> Array:
    """The candidate with the heading and position by which the first and last point lie right."""
    rays, _ = lens.rays(np.array([mapped[0].points[0], mapped[-1].points[0]]))
    level = _landed(rays @ rotation_from_angles(candidate[0], candidate[1], 0.0), candidate)
    places = np.array([mapped[0].place_m, mapped[-1].place_m])
    seen, there = level[1] - level[0], places[1] - places[0]
    # Headings are clockwise from +Y.
    heading = math.atan2(there[0], there[1]) - math.atan2(seen[0], seen[1])
    turned = candidate.copy()
    turned[3] = math.remainder(heading, 2 * math.pi)
    (first,) = _landed(rays[:1] @ rotation_from_angles(*turned[[0, 1, 3]]), turned)
    turned[4:] = places[0] - first
    return turned
