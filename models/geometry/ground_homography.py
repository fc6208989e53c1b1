"""The pose in a homography between the ground and the undistorted image, by the lens.

    H ~ K [r1 r2 t]

with r1 and r2 the first columns of `camera_from_world`: K^-1 H gives them but for a factor.

Source: Zhang 2000, "A Flexible New Technique for Camera Calibration", section 3.1.
"""

import math

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_matrices
from models.geometry.rotation import Array

# Ours. Eight clicked points that are off by 2 px, and a focal length that is off by 5 %, are within
# both; a homography to longitude and latitude, or of a stream of another size, is not.
_MOST_OFF_SHARE = 0.02  # of the image's width: how far the pose's own homography puts a pixel
_MOST_STRETCH = 1.25  # metres along one axis of the ground over metres along the other
_MOST_SKEW = math.radians(10)  # from the right angle between the axes
_LEAST_CONDITION = 1e-9  # smallest singular value over the largest, both axes in camera heights
_GRID = 9  # pixels a side, of the image's ground


def pose_from_homography(image_from_ground: Array, lens: Intrinsics) -> CameraPose:
    """The pose of a homography (3, 3) from ground points (x, y, 1) in metres to pixels (u, v, 1).

    The pixels are undistorted ones of the lens' camera matrix. The ground is seen from above with y
    to the left of x, as a map.

    Raises:
        DegenerateGeometryError: the homography is singular, mirrored, or contradicts the lens.
    """
    matrix = np.asarray(image_from_ground, dtype=np.float64)
    if not np.isfinite(matrix).all() or not np.abs(matrix).max():
        raise DegenerateGeometryError("homography: must have 9 finite numbers that are not all 0")
    bare = np.linalg.inv(lens.matrix) @ (matrix / np.abs(matrix).max())
    lengths = np.linalg.norm(bare[:, :2], axis=0)
    condition = np.linalg.svd(bare / np.maximum(np.linalg.norm(bare, axis=0), 1e-300))[1]
    if not lengths.all() or condition[2] < _LEAST_CONDITION * condition[0]:
        raise DegenerateGeometryError(
            f"homography: must have an inverse (got a determinant of {np.linalg.det(matrix):.3g})"
        )
    stretch = float(lengths.max() / lengths.min())
    if stretch > _MOST_STRETCH:
        raise DegenerateGeometryError(
            f"homography: x and y of the ground must be in the same unit, within a factor of "
            f"{_MOST_STRETCH:g} (got {stretch:.3g}); is the lens that of this image size?"
        )
    skew = math.asin(min(abs(float(bare[:, 0] @ bare[:, 1] / lengths.prod())), 1.0))
    if skew > _MOST_SKEW:
        raise DegenerateGeometryError(
            f"homography: x and y of the ground must be at right angles within "
            f"{math.degrees(_MOST_SKEW):g} deg (got {math.degrees(skew):.1f} deg); is the lens "
            "that of this image size?"
        )
    pose = _upright(bare / math.sqrt(float(lengths.prod())))
    _check_seen(matrix, pose, lens)
    return pose


def inverse_homography(homography: Array) -> Array:
    """The inverse (3, 3), largest number 1.

    Raises:
        DegenerateGeometryError: there is none.
    """
    matrix = np.asarray(homography, dtype=np.float64)
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        inverse = np.full((3, 3), np.inf)
    largest = np.abs(inverse).max()
    if not 0 < largest < np.inf:
        raise DegenerateGeometryError(
            f"homography: must have an inverse (got a determinant of {np.linalg.det(matrix):.3g})"
        )
    return np.asarray(inverse / largest, dtype=np.float64)


def _upright(bare: Array) -> CameraPose:
    """The pose above the ground; the sign of a homography is arbitrary."""
    axes = np.column_stack([bare[:, 0], bare[:, 1], np.cross(bare[:, 0], bare[:, 1])])
    u, _, vt = np.linalg.svd(axes)
    rotation = np.asarray(u @ vt, dtype=np.float64)
    translation = bare[:, 2]
    if (rotation.T @ translation)[2] > 0:  # the centre is -R't
        rotation, translation = rotation @ np.diag([-1.0, -1.0, 1.0]), -translation
    return pose_from_matrices(rotation, translation)


def _check_seen(matrix: Array, pose: CameraPose, lens: Intrinsics) -> None:
    """The lower half of the image shows ground, where the homography has it."""
    across = np.linspace(0, lens.width - 1, _GRID)
    down = np.linspace(lens.height / 2, lens.height - 1, _GRID)
    uv = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = np.column_stack([uv, np.ones(len(uv))]) @ np.linalg.inv(lens.matrix).T @ pose.rotation
    falls = rays[:, 2] < -0.05 * np.linalg.norm(rays, axis=1)
    if falls.mean() < 0.5:
        raise DegenerateGeometryError(
            "homography: the lower half of the image must show the ground in front of the camera "
            f"(got {falls.mean():.0%} of it); is y of the ground mirrored, downwards as in an "
            "image of a plan?"
        )
    rays = rays[falls]
    ground = pose.centre_m[:2] + rays[:, :2] * (pose.height_m / -rays[:, 2:])
    seen = np.column_stack([ground, np.ones(len(ground))]) @ matrix.T
    off = np.linalg.norm(seen[:, :2] / seen[:, 2:] - uv[falls], axis=1)
    worst, most = float(np.median(off)), _MOST_OFF_SHARE * lens.width
    if not worst <= most:
        raise DegenerateGeometryError(
            f"homography: must agree with the lens within {most:.0f} px, in the median of the "
            f"image's lower half (got {worst:.0f} px)"
        )
