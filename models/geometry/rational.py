"""OpenCV's lenses of 8 to 14 coefficients, replaced by one of ours that agrees in the image.

Both of ours are linear in their coefficients, which so follow from rays by least squares: Brown's
five, or for wide lenses the four of a fisheye.

Source: OpenCV, "Camera Calibration and 3D Reconstruction", detailed description.
"""

from typing import NamedTuple

import numpy as np

from models.errors import ShapeError
from models.geometry.folding import first_fold
from models.geometry.intrinsics import Projection
from models.geometry.rotation import Array

_COUNTS = (8, 12, 14)
_RAYS = 41  # a side
_RADII = 1024  # that are tried for the image's corner
_LONGEST = 10.0  # ray, z = 1: 84 deg from the axis
# Calibrations may fold in the last corners of the image, where no board was seen: they are compared
# up to there, and have to reach this share of the way to the corner (half the height, at 16:9).
_LEAST_REACH, _WITHIN_FOLD = 0.5, 0.98


class Replacement(NamedTuple):
    """A lens of ours, and how many pixels it is off at most."""

    projection: Projection
    distortion: tuple[float, ...]
    off_px: float


def replaced(coefficients: Array, focal_px: Array, corner_px: float) -> Replacement:
    """The lens of ours that is nearest within the image.

    `coefficients` (8, 12 or 14) are k1, k2, p1, p2, k3, k4, k5, k6, s1 to s4, tau_x, tau_y;
    `focal_px` (2,) fx and fy; `corner_px` the distance of the farthest corner of the image from the
    principal point.

    Raises:
        ShapeError: another count, a tilted sensor, or a lens that folds within the image.
    """
    if len(coefficients) not in _COUNTS:
        raise ShapeError(f"distortion: must have 8, 12 or 14 numbers (got {len(coefficients)})")
    whole = np.zeros(14)
    whole[: len(coefficients)] = coefficients
    if whole[12:].any():
        raise ShapeError(
            f"distortion: tau_x and tau_y of a tilted sensor must be 0 (got {whole[12]:g}, "
            f"{whole[13]:g})"
        )
    longest = _longest_ray(whole, corner_px / float(min(focal_px)))
    steps = np.linspace(-longest, longest, _RAYS)
    rays = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    rays = rays[np.hypot(*rays.T) <= longest]
    target = _bent(whole, rays)
    x, y = rays.T
    s = x * x + y * y
    brown = [
        [x * s, x * s**2, 2 * x * y, s + 2 * x * x, x * s**3],
        [y * s, y * s**2, s + 2 * y * y, 2 * x * y, y * s**3],
    ]
    angle = np.arctan(np.sqrt(s))
    axis = rays / np.maximum(np.sqrt(s), 1e-12)[:, None]
    fisheye = [[axis[:, n] * angle**power for power in (3, 5, 7, 9)] for n in (0, 1)]
    return min(
        _solved(Projection.PERSPECTIVE, brown, target - rays, focal_px),
        _solved(Projection.FISHEYE, fisheye, target - axis * angle[:, None], focal_px),
        key=lambda each: each.off_px,
    )


def _solved(
    projection: Projection, columns: list[list[Array]], wanted: Array, focal_px: Array
) -> Replacement:
    design = np.concatenate([np.column_stack(columns[n]) * focal_px[n] for n in (0, 1)])
    pixels = (wanted * focal_px).T.ravel()
    found, *_ = np.linalg.lstsq(design, pixels, rcond=None)
    off = (design @ found - pixels).reshape(2, -1)
    return Replacement(projection, tuple(found.tolist()), float(np.hypot(*off).max()))


def _longest_ray(coefficients: Array, corner: float) -> float:
    """The length of the ray that ends in the image's corner, or just before the lens folds."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients[:8]
    above, below = np.array([k3, k2, k1, 1.0]), np.array([k6, k5, k4, 1.0])
    # r N(s) / D(s), s = r^2, grows while N D + 2 s (N' D - N D') is above 0.
    slope: Array = np.polysub(
        np.polymul(np.polyder(above), below), np.polymul(above, np.polyder(below))
    )
    growth = np.polyadd(np.polymul(above, below), np.polymul([2.0, 0.0], slope))
    edge = min(first_fold(tuple(growth.tolist())), first_fold(tuple(below.tolist())), _LONGEST)
    radii = np.linspace(0, edge, _RADII)[:-1]
    s = radii * radii
    image = radii * np.polyval(above, s) / np.polyval(below, s)
    least = _LEAST_REACH * corner
    if image.max() < least:
        raise ShapeError(
            f"distortion: must not fold back within {least:.3g} focal lengths of the principal "
            f"point, half the way to the image's corner (got a fold at {image.max():.3g})"
        )
    return float(np.interp(min(corner, _WITHIN_FOLD * image.max()), image, radii))


def _bent(coefficients: Array, rays: Array) -> Array:
    """Image points (N, 2), focal length 1, of rays (N, 2), z = 1."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients[:12]
    x, y = rays.T
    s = x * x + y * y
    radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    return np.column_stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s * (s1 + s * s2),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s * (s3 + s * s4),
        ]
    )
