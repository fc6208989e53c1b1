"""The lens: focal lengths, principal point and OpenCV's distortion, both ways.

How it bends rays is in `brown` and `fisheye`: here alone a projection is chosen by its name.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

import numpy as np

from models.errors import ShapeError
from models.geometry.brown import Brown
from models.geometry.fisheye import Fisheye
from models.geometry.rotation import Array, Mask

_BORDER_PX, _BORDER_SHARE = 2.0, 0.003  # of the image's height


class Projection(StrEnum):
    """How rays become a picture, before the focal length: by their tangent, or by their angle."""

    PERSPECTIVE = "perspective"
    FISHEYE = "fisheye"


_BENDINGS: dict[str, type[Brown] | type[Fisheye]] = {
    Projection.PERSPECTIVE: Brown,
    Projection.FISHEYE: Fisheye,
}


def coefficients_of(projection: str) -> tuple[str, ...]:
    """The names of a projection's coefficients, in OpenCV's order."""
    return _BENDINGS[projection]._fields


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Intrinsics in pixels; `distortion` is (k1, k2, p1, p2, k3) in OpenCV's order.

    Of a fisheye it is (k1, k2, k3, k4) of `cv2.fisheye`; left out, it is 0.

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
    distortion: tuple[float, ...] = ()
    projection: Projection = Projection.PERSPECTIVE

    def __post_init__(self) -> None:
        for name in ("width", "height", "fx", "fy"):
            if not 0 < getattr(self, name) < 1e6:
                raise ShapeError(
                    f"{name}: must be above 0 and below 1e6, got {getattr(self, name)}"
                )
        if self.projection not in _BENDINGS:
            raise ShapeError(f"projection: perspective or fisheye, got {self.projection!r:.40}")
        object.__setattr__(self, "projection", Projection(self.projection))
        names = coefficients_of(self.projection)
        given = tuple(self.distortion) or (0.0,) * len(names)
        if len(given) != len(names):
            raise ShapeError(
                f"distortion: {len(names)} numbers are needed, got {len(given)} of "
                f"{', '.join(names)}"
            )
        object.__setattr__(self, "distortion", given)
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
        return 2 * self._bending.angle_rad(self.width / 2 / self.fx)

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def max_radius(self) -> float:
        """The length of the longest rays, z = 1, that the lens takes into its picture."""
        return self._bending.max_radius

    @property
    def fold_radius(self) -> float:
        """The image radius, focal length 1, at which the distortion folds back; infinite if not."""
        return self._bending.fold_radius

    @property
    def widest_rad(self) -> float:
        """The widest view that a lens of this projection is made for."""
        return self._bending.widest_rad

    @property
    def pinhole(self) -> Self:
        """A lens without distortion whose picture, of the same size, ends about where this does."""
        edge = self._bending.undistorted_edge
        corners = np.array([[-0.5, -0.5], [self.width - 0.5, self.height - 0.5]])
        (left, top), (right, bottom) = (map(edge, corner) for corner in self._image(corners))
        fx, fy = self.width / (right - left), self.height / (bottom - top)
        cx, cy = -0.5 - fx * left, -0.5 - fy * top
        return type(self)(width=self.width, height=self.height, fx=fx, fy=fy, cx=cx, cy=cy)

    @property
    def _bending(self) -> Brown | Fisheye:
        return _BENDINGS[self.projection](*self.distortion)

    def project(self, points_camera: Array) -> tuple[Array, Mask]:
        """Pixels (..., 2) of points (..., 3) in the camera frame, and which are valid (...).

        Valid are points in front of the camera that the distortion does not fold back; they may
        lie outside the image. The others are NaN.
        """
        depth = points_camera[..., 2]
        in_front = depth > 1e-9
        rays = points_camera[..., :2] / np.where(in_front, depth, 1.0)[..., None]
        valid = in_front & (np.hypot(rays[..., 0], rays[..., 1]) < self.max_radius)
        uv = self._bending.bent(rays) * (self.fx, self.fy) + (self.cx, self.cy)
        return np.where(valid[..., None], uv, np.nan), valid

    def rays(self, uv: Array) -> tuple[Array, Mask]:
        """Directions (..., 3), z = 1, in the camera frame of pixels (..., 2), and which are valid.

        A pixel that no ray reaches is NaN and not valid.
        """
        estimate, valid = self._bending.straightened(self._image(uv))
        directions = np.concatenate([estimate, np.ones_like(estimate[..., :1])], axis=-1)
        return np.where(valid[..., None], directions, np.nan), valid

    def beyond(self, uv: Array) -> Mask:
        """Mask (...) of pixels (..., 2) that a fisheye has no picture of; of another lens none."""
        return self._bending.beyond(self._image(uv))

    @property
    def beyond_words(self) -> str:
        """What a pixel needs that is not beyond it."""
        return (
            f"a pixel of the {self.projection} lens, within "
            f"{math.degrees(math.atan(self.max_radius)):.0f} deg of its axis, is needed"
        )

    def pulled_in(self, uv: Array) -> Array:
        """Pixels (..., 2), those beyond what a fisheye sees on its border instead."""
        return self._bending.pulled_in(self._image(uv)) * (self.fx, self.fy) + (self.cx, self.cy)

    def _image(self, uv: Array) -> Array:
        return (np.asarray(uv, np.float64) - (self.cx, self.cy)) / (self.fx, self.fy)

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
