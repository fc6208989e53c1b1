"""Differentiable RANSAC: the expected loss of poses by samples of scene coordinates.

Sources: Brachmann et al. 2017 (DSAC), equations 2 to 4; Brachmann and Rother 2018 (DSAC++), the
soft count of inliers in place of a scoring network. Poses come of three points, a fourth choosing
among the solutions, and are derived by differences; they are not refined while learning.
"""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from models.errors import TooFewTrajectoriesError
from models.geometry.rotation import Array

_POINTS = 4
_DRAWS = 10  # for a hypothesis, until four points make a pose
_THRESHOLD = 10.0 / 1000  # of the focal length: ten pixels of a usual lens, as in DSAC++
_SHARPNESS = 5 / _THRESHOLD  # of the edge between in and out: a tenth of the threshold wide
_SCORE_SCALE = 0.1
_DIFFERENCE = 1e-3  # metres
_FAR = 1e3  # of a pose that four moved points no longer make


def pose_of_points(coordinates_m: Array, rays: Array) -> Array | None:
    """The pose (6,), Rodrigues vector and translation, of 4 points (4, 3) and rays (4, 2); or None.

    `camera_from_world`; rays are x / z and y / z. None where the points make none.
    """
    world, image = (np.ascontiguousarray(each, np.float64) for each in (coordinates_m, rays))
    try:
        found, turn, shift = cv2.solvePnP(world, image, np.eye(3), None, flags=cv2.SOLVEPNP_P3P)
    except cv2.error:
        return None
    if not found or turn is None:
        return None
    pose = np.concatenate([turn.ravel(), shift.ravel()])
    return pose if np.isfinite(pose).all() else None


class _PoseOfPoints(torch.autograd.Function):
    """`pose_of_points` with its derivative by differences."""

    @staticmethod
    def forward(ctx: Any, coordinates: Tensor, rays: Array) -> Tensor:
        world = coordinates.detach().double().numpy()
        pose = pose_of_points(world, rays)
        assert pose is not None, "drawn so that it makes one"
        jacobian = np.zeros((6, _POINTS * 3))
        for place in range(_POINTS * 3):
            moved = []
            for sign in (-1, 1):
                other = world.copy()
                other.flat[place] += sign * _DIFFERENCE
                moved.append(pose_of_points(other, rays))
            if moved[0] is not None and moved[1] is not None:
                jacobian[:, place] = (moved[1] - moved[0]) / (2 * _DIFFERENCE)
        # Another of the solutions may be chosen a millimetre on: that is no derivative.
        jacobian[np.abs(jacobian) > _FAR] = 0.0
        ctx.save_for_backward(torch.from_numpy(jacobian))
        return torch.from_numpy(pose).to(coordinates.dtype)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (jacobian,) = ctx.saved_tensors
        (gradient,) = gradients
        own = gradient.double() @ jacobian
        return own.reshape(_POINTS, 3).to(gradient.dtype), None


# torch has it without types in some of the releases that we run on.
_derived_pose: Callable[[Tensor, Array], Tensor] = _PoseOfPoints.apply


def hypotheses(
    coordinates: Tensor, rays: Array, count: int, rng: np.random.Generator
) -> list[Tensor]:
    """Up to `count` poses (6,) of four drawn points each, of coordinates (N, 3) and rays (N, 2)."""
    world = coordinates.detach().double().numpy()
    found = []
    for _ in range(count):
        drawn = _drawn_pose(world, rays, rng)
        if drawn is None:
            continue
        rows, values = drawn
        pose: Tensor = torch.from_numpy(values)
        if coordinates.requires_grad:
            pose = _derived_pose(coordinates[rows], rays[rows])
        found.append(pose)
    return found


def expected_loss(
    coordinates: Tensor,
    rays: Array,
    loss: Callable[[Tensor], Tensor],
    count: int,
    rng: np.random.Generator,
) -> Tensor | None:
    """The loss of poses, each by how likely RANSAC is to choose it; None where there is none.

    Source: Brachmann et al. 2017, equation 4.
    """
    poses = hypotheses(coordinates, rays, count, rng)
    if not poses:
        return None
    scores = torch.stack([_inliers(pose, coordinates, rays) for pose in poses])
    chances = torch.softmax(_SCORE_SCALE * scores, dim=0)
    return (chances * torch.stack([loss(pose) for pose in poses])).sum()


def best_pose(coordinates_m: Array, rays: Array, count: int, rng: np.random.Generator) -> Array:
    """The pose (6,) of the most inliers, refined on these.

    Raises:
        TooFewTrajectoriesError: no four of the points make a pose.
    """
    world = torch.from_numpy(coordinates_m)
    poses = hypotheses(world, rays, count, rng)
    if not poses:
        raise TooFewTrajectoriesError(
            f"coordinates: no {_POINTS} of {len(rays)} points make a pose, in {count} draws"
        )
    best = max(poses, key=lambda pose: float(_inliers(pose, world, rays))).numpy()
    inlier = _misses(torch.from_numpy(best), world, rays).numpy() < _THRESHOLD
    if inlier.sum() < _POINTS:
        return np.asarray(best)
    turn, shift = cv2.solvePnPRefineLM(
        coordinates_m[inlier], rays[inlier], np.eye(3), None, best[:3].copy(), best[3:].copy()
    )
    return np.concatenate([turn.ravel(), shift.ravel()])


def rotation_of_turn(turn: Array) -> Array:
    """The matrix (3, 3) of a Rodrigues vector (3,)."""
    return np.asarray(cv2.Rodrigues(turn)[0])


def rotation_of(turn: Tensor) -> Tensor:
    """The same, to be derived."""
    zero = torch.zeros((), dtype=turn.dtype)
    x, y, z = turn
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    rotation: Tensor = torch.linalg.matrix_exp(cross)
    return rotation


def _drawn_pose(
    world: Array, rays: Array, rng: np.random.Generator
) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Four drawn points and their pose (6,); None where ten draws make none."""
    if len(rays) < _POINTS:
        return None
    for _ in range(_DRAWS):
        rows = rng.choice(len(rays), _POINTS, replace=False)
        pose = pose_of_points(world[rows], rays[rows])
        if pose is not None:
            return rows, pose
    return None


def _inliers(pose: Tensor, coordinates: Tensor, rays: Array) -> Tensor:
    """The soft count of points that a pose puts where they are seen."""
    misses = _misses(pose, coordinates, rays)
    count: Tensor = torch.sigmoid(_SHARPNESS * (_THRESHOLD - misses)).sum()
    return count


def _misses(pose: Tensor, coordinates: Tensor, rays: Array) -> Tensor:
    """Reprojection errors (N,) in focal lengths; large where a point is behind the camera."""
    seen = coordinates @ rotation_of(pose[:3]).T + pose[3:]
    depth = seen[:, 2].clamp(min=0.1)
    target = torch.from_numpy(rays).to(coordinates.dtype)
    misses: Tensor = torch.linalg.vector_norm(seen[:, :2] / depth[:, None] - target, dim=1)
    return misses
