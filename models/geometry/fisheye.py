"""A fisheye lens: the image radius follows the angle from the axis, not its tangent.

Source: Kannala and Brandt 2006, "A Generic Camera Model and Calibration Method", the radially
symmetric part with the terms of `cv2.fisheye`.
"""

import math
from typing import NamedTuple

import numpy as np

from models.geometry.folding import first_fold
from models.geometry.rotation import Array, Mask

# Rays have z = 1: at a right angle to the axis there is none, and here one is 29 long.
MOST_ANGLE_RAD = math.radians(88.0)
_NEWTON_STEPS = 30
_TABLE = 512  # places
_CONVERGED = 1e-12
_TINY = 1e-9
_WITHIN = 0.999  # of the radius that is reached, where a border is to be seen


class Fisheye(NamedTuple):
    """The coefficients of theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9."""

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0

    @property
    def widest_rad(self) -> float:
        """The widest view that such a lens is made for."""
        return math.radians(280)

    @property
    def max_angle_rad(self) -> float:
        """The angle from the axis up to which rays are known: 88 deg, or where the image folds."""
        slope = (9 * self.k4, 7 * self.k3, 5 * self.k2, 3 * self.k1, 1.0)  # in theta^2
        return min(MOST_ANGLE_RAD, first_fold(slope))

    @property
    def max_radius(self) -> float:
        """The length of the longest rays, z = 1."""
        return math.tan(self.max_angle_rad)

    @property
    def fold_radius(self) -> float:
        """The image radius of the fold; infinite if the image grows up to 88 deg from the axis."""
        return self._reach if self.max_angle_rad < MOST_ANGLE_RAD else math.inf

    def angle_rad(self, radius: float) -> float:
        """The angle from the axis that an image radius is of, by the focal length alone."""
        return radius

    def undistorted_edge(self, image: float) -> float:
        """Where a picture's edge is taken to be, on the axis, once distortion is left out."""
        rays, _ = self.straightened(self.pulled_in(np.array([image, 0.0])))
        return float(rays[0])

    @property
    def _reach(self) -> float:
        """The image radius up to which rays are known."""
        return float(self._image_radius(np.array(self.max_angle_rad)))

    def beyond(self, image: Array) -> Mask:
        """Mask (...) of image points (..., 2) that no ray reaches."""
        return np.asarray(np.hypot(image[..., 0], image[..., 1]) >= self._reach)

    def pulled_in(self, image: Array) -> Array:
        """Image points (..., 2), those that no ray reaches at the border of what is reached."""
        reached = _WITHIN * self._reach
        radius = np.hypot(image[..., 0], image[..., 1])
        share = np.minimum(1.0, reached / np.maximum(radius, _TINY))
        return np.asarray(image * share[..., None])

    def bent(self, rays: Array) -> Array:
        """Image points (..., 2), focal length 1, of rays (..., 2), z = 1."""
        radius = np.hypot(rays[..., 0], rays[..., 1])
        image = self._image_radius(np.arctan(radius))
        # The limit in the middle is 1.
        share = np.where(radius > _TINY, image / np.maximum(radius, _TINY), 1.0)
        return np.asarray(rays * share[..., None])

    def straightened(self, image: Array) -> tuple[Array, Mask]:
        """Rays (..., 2), z = 1, of image points (..., 2), and which are valid (...).

        Newton's method on the angle, which is held within the lens: there the image radius grows.
        It begins near the angle, by a table: of a lens that almost folds it would not come there.
        """
        wanted = np.hypot(image[..., 0], image[..., 1])
        limit = self.max_angle_rad
        table = np.linspace(0.0, limit, _TABLE)
        angle = np.interp(wanted, self._image_radius(table), table)
        for _ in range(_NEWTON_STEPS):
            miss = self._image_radius(angle) - wanted
            if np.nanmax(np.abs(miss), initial=0.0) < _CONVERGED:
                break
            slope = np.maximum(self._slope(angle), 1e-3)
            angle = np.clip(angle - miss / slope, 0.0, limit)
        near = np.abs(self._image_radius(angle) - wanted) < 1e-9
        share = np.where(wanted > _TINY, np.tan(angle) / np.maximum(wanted, _TINY), 1.0)
        return np.asarray(image * share[..., None]), near & (angle < limit)

    def _image_radius(self, angle: Array) -> Array:
        s = angle * angle
        return np.asarray(angle * (1 + s * (self.k1 + s * (self.k2 + s * (self.k3 + s * self.k4)))))

    def _slope(self, angle: Array) -> Array:
        s = angle * angle
        k1, k2, k3, k4 = self
        return np.asarray(1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4))))
