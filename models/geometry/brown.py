"""Brown's lens: radial and tangential distortion of a perspective picture, both ways.

Source: OpenCV, "Camera Calibration and 3D Reconstruction", detailed description.
"""

import math
from typing import NamedTuple

import numpy as np

from models.geometry.folding import first_fold
from models.geometry.rotation import Array, Mask

_NEWTON_STEPS = 30
_CONVERGED = 1e-10  # normalised units; 1e-7 px on a long lens


class Brown(NamedTuple):
    """OpenCV's five coefficients, in its order."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def widest_rad(self) -> float:
        """The widest view that such a lens is made for."""
        return math.radians(150)

    @property
    def max_radius(self) -> float:
        """The normalised radius up to which the radial distortion still grows.

        Beyond it the polynomial folds back and would put points from far outside the view
        into the image; such points are not valid. Infinite where it never folds.
        """
        # d/dr r (1 + k1 r^2 + k2 r^4 + k3 r^6) as a polynomial in s = r^2
        return first_fold((7 * self.k3, 5 * self.k2, 3 * self.k1, 1.0))

    @property
    def fold_radius(self) -> float:
        """The image radius of the radial distortion's fold; infinite where it never folds."""
        longest = self.max_radius
        return (
            longest * float(self._radial(np.array(longest**2))) if longest < math.inf else longest
        )

    def angle_rad(self, radius: float) -> float:
        """The angle from the axis that an image radius is of, by the focal length alone."""
        return math.atan(radius)

    def undistorted_edge(self, image: float) -> float:
        """Where a picture's edge is taken to be, on the axis, once distortion is left out."""
        return image

    def pulled_in(self, image: Array) -> Array:
        """Image points (..., 2), as they are: a picture's edge is within a lens of this kind."""
        return image

    def beyond(self, image: Array) -> Mask:
        """Mask (...) of image points (..., 2) that it has no picture of: none."""
        return np.zeros(image.shape[:-1], dtype=bool)

    def bent(self, rays: Array) -> Array:
        """Image points (..., 2), focal length 1, of rays (..., 2), z = 1."""
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        with np.errstate(over="ignore", invalid="ignore"):
            radial = self._radial(s)
            return np.stack(
                [
                    x * radial + 2 * self.p1 * x * y + self.p2 * (s + 2 * x * x),
                    y * radial + self.p1 * (s + 2 * y * y) + 2 * self.p2 * x * y,
                ],
                axis=-1,
            )

    def straightened(self, image: Array) -> tuple[Array, Mask]:
        """Rays (..., 2), z = 1, of image points (..., 2), and which are valid (...).

        Newton's method; a point that no ray reaches is not valid.
        """
        if not any(self):
            return image, np.asarray(np.isfinite(image).all(axis=-1))
        estimate = image * self._undistorted_share(image)
        for _ in range(_NEWTON_STEPS):
            value, jacobian = self._bent_and_jacobian(estimate)
            miss = value - image
            if np.nanmax(np.abs(miss), initial=0.0) < _CONVERGED / 10:
                break
            (a, b), (c, d) = np.moveaxis(jacobian, (-2, -1), (0, 1))
            determinant = a * d - b * c
            step = np.stack(
                [d * miss[..., 0] - b * miss[..., 1], a * miss[..., 1] - c * miss[..., 0]], -1
            )
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                step = step / determinant[..., None]
            # A long step leaves the region where the polynomial is a lens.
            length = np.linalg.norm(step, axis=-1, keepdims=True)
            estimate = estimate - step * np.minimum(1.0, 0.25 / np.maximum(length, 1e-300))
        near = np.abs(self.bent(estimate) - image).max(-1) < _CONVERGED
        within = np.hypot(estimate[..., 0], estimate[..., 1]) < self.max_radius
        return estimate, np.asarray(near & within)

    def _undistorted_share(self, distorted: Array) -> Array:
        """About how much longer (..., 1) the undistorted rays are, by the radial terms alone.

        Newton's method must start within the lens: the distorted radius may lie beyond its edge.
        """
        radius = np.linspace(0, min(0.999 * self.max_radius, 10.0), 512)[1:]
        table = radius * self._radial(radius * radius)
        wanted = np.linalg.norm(distorted, axis=-1)
        start = np.interp(wanted, table, radius, left=0.0)
        near_centre = wanted <= table[0]
        return np.where(near_centre, 1.0, start / np.where(near_centre, 1.0, wanted))[..., None]

    def _radial(self, squared_radius: Array) -> Array:
        """Factor by which the lens lengthens a ray of a squared radius (...)."""
        s = squared_radius
        return 1 + s * (self.k1 + s * (self.k2 + s * self.k3))

    def _bent_and_jacobian(self, rays: Array) -> tuple[Array, Array]:
        """Image points (..., 2) of rays (..., 2), and the Jacobian (..., 2, 2)."""
        k1, k2, p1, p2, k3 = self
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        value = self.bent(rays)
        with np.errstate(over="ignore", invalid="ignore"):
            radial = self._radial(s)
            slope = 2 * (k1 + s * (2 * k2 + s * 3 * k3))  # d radial / d(s) times 2
            cross = x * y * slope + 2 * p1 * x + 2 * p2 * y
            jacobian = np.stack(
                [
                    np.stack([radial + x * x * slope + 2 * p1 * y + 6 * p2 * x, cross], -1),
                    np.stack([cross, radial + y * y * slope + 6 * p1 * y + 2 * p2 * x], -1),
                ],
                axis=-2,
            )
        return value, jacobian
