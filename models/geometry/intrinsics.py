"""The lens: focal lengths, principal point and OpenCV's distortion, both ways."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from models.errors import ShapeError
from models.geometry.rotation import Array, Mask

_NEWTON_STEPS = 30
_NO_DISTORTION = 1e-9  # a coefficient that moves no pixel
_BORDER_PX, _BORDER_SHARE = 2.0, 0.003  # of the image's height
_CONVERGED = 1e-10  # normalised units; 1e-7 px on a long lens


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Intrinsics in pixels; `distortion` is (k1, k2, p1, p2, k3) in OpenCV's order.

    Pixel (u, v) has u right and v down; integers are pixel centres.

    Raises:
        ShapeError: a size or focal length is not above 0, or a number is not finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("width", "height", "fx", "fy"):
            if not 0 < getattr(self, name) < 1e6:
                raise ShapeError(
                    f"{name}: must be above 0 and below 1e6, got {getattr(self, name)}"
                )
        if len(self.distortion) != 5:
            raise ShapeError(f"distortion: 5 numbers are needed, got {len(self.distortion)}")
        if not all(math.isfinite(value) for value in (self.cx, self.cy, *self.distortion)):
            raise ShapeError("cx, cy, distortion: must be finite")

    @classmethod
    def of_view(cls, *, width: int, height: int, hfov_rad: float) -> Self:
        """The pinhole that sees an angle from the left edge to the right, pixels being square.

        Raises:
            ShapeError: as of the lens itself.
        """
        return cls._centred(width, height, focal_px=width / 2 / math.tan(hfov_rad / 2))

    @classmethod
    def of_sensor(
        cls, *, width: int, height: int, focal_mm: float, sensor_mm: tuple[float, float]
    ) -> Self:
        """The pinhole of a focal length before a sensor of (width, height), both in millimetres.

        Pixels are square. A picture of another shape than the sensor is taken to be cut from it
        on the one side that has to be cut.

        Raises:
            ShapeError: as of the lens itself.
        """
        pitch_mm = min(sensor_mm[0] / width, sensor_mm[1] / height)
        return cls._centred(width, height, focal_px=focal_mm / pitch_mm)

    @classmethod
    def _centred(cls, width: int, height: int, *, focal_px: float) -> Self:
        cx, cy = (width - 1) / 2, (height - 1) / 2
        return cls(width=width, height=height, fx=focal_px, fy=focal_px, cx=cx, cy=cy)

    @property
    def hfov_rad(self) -> float:
        """The angle that the picture is wide, by its focal length alone."""
        return 2 * math.atan(self.width / 2 / self.fx)

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def max_radius(self) -> float:
        """The normalised radius up to which the radial distortion still grows.

        Beyond it the polynomial folds back and would put points from far outside the view
        into the image; such points are not valid. Infinite where it never folds.
        """
        k1, k2, _, _, k3 = self.distortion
        # d/dr r (1 + k1 r^2 + k2 r^4 + k3 r^6) as a polynomial in s = r^2
        slope = np.array([7 * k3, 5 * k2, 3 * k1, 1.0])
        roots = np.roots(np.where(np.abs(slope) < _NO_DISTORTION, 0.0, slope))
        real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
        return float(np.sqrt(real.min())) if real.size else math.inf

    def project(self, points_camera: Array) -> tuple[Array, Mask]:
        """Pixels (..., 2) of points (..., 3) in the camera frame, and which are valid (...).

        Valid are points in front of the camera that the distortion does not fold back; they may
        lie outside the image. The others are NaN.

        Source: OpenCV, "Camera Calibration and 3D Reconstruction", detailed description.
        """
        depth = points_camera[..., 2]
        in_front = depth > 1e-9
        rays = points_camera[..., :2] / np.where(in_front, depth, 1.0)[..., None]
        valid = in_front & (np.hypot(rays[..., 0], rays[..., 1]) < self.max_radius)
        distorted = self._distorted(rays)
        uv = distorted * (self.fx, self.fy) + (self.cx, self.cy)
        return np.where(valid[..., None], uv, np.nan), valid

    def rays(self, uv: Array) -> tuple[Array, Mask]:
        """Directions (..., 3), z = 1, in the camera frame of pixels (..., 2), and which are valid.

        Newton's method on the distortion; a pixel that no ray reaches is NaN and not valid.
        """
        target = (np.asarray(uv, np.float64) - (self.cx, self.cy)) / (self.fx, self.fy)
        estimate = target
        if any(self.distortion):
            estimate = target * self._undistorted_share(target)
            for _ in range(_NEWTON_STEPS):
                value, jacobian = self._distort(estimate)
                miss = value - target
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
            near = np.abs(self._distorted(estimate) - target).max(-1) < _CONVERGED
            valid = near & (np.hypot(estimate[..., 0], estimate[..., 1]) < self.max_radius)
        else:
            valid = np.isfinite(target).all(axis=-1)
        directions = np.concatenate([estimate, np.ones_like(estimate[..., :1])], axis=-1)
        return np.where(valid[..., None], directions, np.nan), valid

    def contains(self, uv: Array, margin_px: float = 0.0) -> Mask:
        """Mask of pixels (..., 2) inside the image, widened by a margin; NaN is not."""
        u, v = uv[..., 0], uv[..., 1]
        across = (u >= -0.5 - margin_px) & (u <= self.width - 0.5 + margin_px)
        return np.asarray(across & (v >= -0.5 - margin_px) & (v <= self.height - 0.5 + margin_px))

    def shows_foot(self, uv: Array) -> Mask:
        """Mask of pixels (..., 2) that can be feet: inside the image, and not at its lower border.

        There boxes end whose feet are beyond it: within two pixels, or 0.3 % of the height.
        """
        lowest = self.height - 0.5 - max(_BORDER_PX, _BORDER_SHARE * self.height)
        return np.asarray(self.contains(uv) & (uv[..., 1] < lowest))

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
        k1, k2, _, _, k3 = self.distortion
        s = squared_radius
        return 1 + s * (k1 + s * (k2 + s * k3))

    def _distorted(self, rays: Array) -> Array:
        """Distorted rays (..., 2)."""
        _, _, p1, p2, _ = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        with np.errstate(over="ignore", invalid="ignore"):
            radial = self._radial(s)
            return np.stack(
                [
                    x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
                    y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
                ],
                axis=-1,
            )

    def _distort(self, rays: Array) -> tuple[Array, Array]:
        """Distorted rays (..., 2) and the Jacobian (..., 2, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        s = x * x + y * y
        value = self._distorted(rays)
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
