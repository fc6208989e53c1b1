"""Rotations `camera_from_world`: angles, quaternions, distances and means; products of vectors.

A rotation matrix has the camera's right, down and forward axes as its rows, in world
coordinates (Z up). The signs are pinned by `tests/models/geometry/test_rotation.py`.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from models.errors import ShapeError

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Index = npt.NDArray[np.int64]


def rotation_from_angles(tilt_rad: Any, roll_rad: Any, heading_rad: Any) -> Array:
    """Rotation matrices (..., 3, 3), `camera_from_world`, of broadcast angles (...).

    Tilt is positive looking down, roll positive with the right side lower, heading clockwise
    from world +Y seen from above. Level and looking along +Y with tilt 30 deg, the forward row
    is (0, 0.866, -0.5).
    """
    tilt, roll, heading = np.broadcast_arrays(
        *(np.asarray(angle, dtype=np.float64) for angle in (tilt_rad, roll_rad, heading_rad))
    )
    if tilt.ndim == 0:
        return _rotation(float(tilt), float(roll), float(heading))
    rows = _rows(
        *(turn for angle in (tilt, roll, heading) for turn in (np.cos(angle), np.sin(angle)))
    )
    rotation = np.empty((*tilt.shape, 3, 3))
    for number, row in enumerate(rows):
        for axis, entries in enumerate(row):
            rotation[..., number, axis] = entries
    return rotation


def _rotation(tilt_rad: float, roll_rad: float, heading_rad: float) -> Array:
    """One of them: estimators ask for tens of thousands, each alone."""
    turns = [turn(a) for a in (tilt_rad, roll_rad, heading_rad) for turn in (math.cos, math.sin)]
    return np.array(_rows(*turns))


def _rows(
    cos_tilt: Any, sin_tilt: Any, cos_roll: Any, sin_roll: Any, cos_heading: Any, sin_heading: Any
) -> list[list[Any]]:
    """The rows right, down, forward: the level camera's first two, turned about the third."""
    down0 = [-sin_heading * sin_tilt, -cos_heading * sin_tilt, -cos_tilt]
    return [
        [
            cos_roll * cos_heading + sin_roll * down0[0],
            -cos_roll * sin_heading + sin_roll * down0[1],
            sin_roll * down0[2],
        ],
        [
            -sin_roll * cos_heading + cos_roll * down0[0],
            sin_roll * sin_heading + cos_roll * down0[1],
            cos_roll * down0[2],
        ],
        [sin_heading * cos_tilt, cos_heading * cos_tilt, -sin_tilt],
    ]


def rotation_and_derivatives(
    tilt_rad: float, roll_rad: float, heading_rad: float
) -> tuple[Array, Array]:
    """A rotation `camera_from_world` (3, 3) and its derivatives (2, 3, 3) by tilt and roll.

    Tilting turns forward towards down0 and down0 away from forward; rolling turns right towards
    down and down away from right.
    """
    rotation = _rotation(tilt_rad, roll_rad, heading_rad)
    derivatives = np.zeros((2, 3, 3))
    level = _rotation(tilt_rad, 0.0, heading_rad)  # right0, down0, forward
    derivatives[0, 0] = -math.sin(roll_rad) * level[2]
    derivatives[0, 1] = -math.cos(roll_rad) * level[2]
    derivatives[0, 2] = level[1]
    derivatives[1, 0], derivatives[1, 1] = rotation[1], -rotation[0]
    return rotation, derivatives


def angles_from_rotation(rotation: Array) -> tuple[Array, Array, Array]:
    """Tilt, roll and heading in radians, each (...), of rotations (..., 3, 3).

    Straight up or down heading and roll turn about the same axis; then roll is 0.
    """
    right, forward = rotation[..., 0, :], rotation[..., 2, :]
    level = np.hypot(forward[..., 0], forward[..., 1])
    tilt = np.arctan2(-forward[..., 2], level)
    upright = level > 1e-12
    heading = np.where(
        upright,
        np.arctan2(forward[..., 0], forward[..., 1]),
        np.arctan2(-right[..., 1], right[..., 0]),
    )
    right0 = np.stack([np.cos(heading), -np.sin(heading), np.zeros_like(heading)], axis=-1)
    down0 = np.cross(forward, right0)
    roll = np.arctan2((right * down0).sum(-1), (right * right0).sum(-1))
    return tilt, roll, heading


def quaternion_from_rotation(rotation: Array) -> Array:
    """Unit quaternions wxyz (..., 4), w >= 0, of rotations (..., 3, 3)."""
    r = rotation
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # The outer product 4 q q^T from the matrix; its longest row is q, scaled.
    outer = np.empty((*r.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1 + xx + yy + zz
    outer[..., 1, 1] = 1 + xx - yy - zz
    outer[..., 2, 2] = 1 - xx + yy - zz
    outer[..., 3, 3] = 1 - xx - yy + zz
    outer[..., 0, 1] = outer[..., 1, 0] = r[..., 2, 1] - r[..., 1, 2]
    outer[..., 0, 2] = outer[..., 2, 0] = r[..., 0, 2] - r[..., 2, 0]
    outer[..., 0, 3] = outer[..., 3, 0] = r[..., 1, 0] - r[..., 0, 1]
    outer[..., 1, 2] = outer[..., 2, 1] = r[..., 0, 1] + r[..., 1, 0]
    outer[..., 1, 3] = outer[..., 3, 1] = r[..., 0, 2] + r[..., 2, 0]
    outer[..., 2, 3] = outer[..., 3, 2] = r[..., 1, 2] + r[..., 2, 1]
    longest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, longest[..., None, None], axis=-2)[..., 0, :]
    return _canonical(row / np.linalg.norm(row, axis=-1, keepdims=True))


def rotation_from_quaternion(quaternion_wxyz: Any) -> Array:
    """Rotations (..., 3, 3) of quaternions wxyz (..., 4), normalised first.

    Raises:
        ShapeError: the last axis is not 4 long, or a quaternion has no length.
    """
    q = np.asarray(quaternion_wxyz, dtype=np.float64)
    if q.shape[-1:] != (4,):
        raise ShapeError(f"quaternion_wxyz: 4 numbers (w, x, y, z) are needed, got {q.shape}")
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(norm > 1e-12):
        raise ShapeError("quaternion_wxyz: length must be above 0, got 0")
    w, x, y, z = np.moveaxis(q / norm, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angle_between(first_wxyz: Any, second_wxyz: Any) -> Array:
    """Whole rotation angle in radians, (...), between unit quaternions (..., 4).

    Source: 2 acos |<q1, q2>|, computed by atan2 so that small angles keep their digits.
    """
    first, second = np.broadcast_arrays(
        np.asarray(first_wxyz, np.float64), np.asarray(second_wxyz, np.float64)
    )
    sign = np.where((first * second).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    apart = np.linalg.norm(first - sign * second, axis=-1)
    together = np.linalg.norm(first + sign * second, axis=-1)
    return np.asarray(4 * np.arctan2(apart, together))


def mean_quaternion(quaternions_wxyz: Array, weights: Array | None = None) -> Array:
    """Mean orientation (..., 4), w >= 0, of quaternions (..., N, 4); q and -q count as one.

    `weights` (..., N) are not negative; all one if left out.

    Source: Markley et al., "Averaging Quaternions", JGCD 30(4), 2007, eq. 12-13.
    """
    q = quaternions_wxyz
    weighted = q if weights is None else q * weights[..., None]
    moment = np.swapaxes(weighted, -1, -2) @ q  # eq. 12
    _, vectors = np.linalg.eigh(moment)  # ascending eigenvalues
    return _canonical(vectors[..., :, -1])  # eq. 13


def nearest_rotation(matrix: Any) -> Array:
    """The rotation (3, 3) nearest to a matrix that is one up to rounding.

    Raises:
        ShapeError: not 3 x 3, or farther than 1e-3 from a rotation, or a reflection.
    """
    given = np.asarray(matrix, dtype=np.float64)
    if given.shape != (3, 3) or not np.isfinite(given).all():
        raise ShapeError(f"rotation: a finite 3 x 3 matrix is needed, got shape {given.shape}")
    left, _, right = np.linalg.svd(given)
    nearest = left @ right
    distance = float(np.abs(nearest - given).max())
    if np.linalg.det(nearest) < 0:
        raise ShapeError("rotation: determinant must be +1, got -1 (a reflection)")
    if distance > 1e-3:
        raise ShapeError(f"rotation: must be orthonormal within 0.001, is off by {distance:.4g}")
    return np.asarray(nearest)


def _canonical(q: Array) -> Array:
    return np.where(q[..., :1] < 0, -q, q)


def dot(first: Array, second: Array) -> Array:
    """Products (...) of vectors (..., K)."""
    # Over an axis of two or three, `sum` takes three times as long.
    return np.asarray(np.einsum("...k,...k->...", first, second))


def norm(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., K)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def aside_of(directions: Array) -> Array:
    """Vectors (M, 2) a quarter turn to the left of others (M, 2)."""
    return np.column_stack([-directions[:, 1], directions[:, 0]])


def rotation_from_vector(vector: Any) -> Array:
    """Rotation (3, 3) about a vector (3,) by its length in radians, as OpenCV's `Rodrigues`."""
    axis = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(axis))
    half = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    return rotation_from_quaternion([math.cos(angle / 2), *(half * axis)])
