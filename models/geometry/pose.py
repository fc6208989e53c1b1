"""The pose of a fixed camera, as a value."""

import math
from dataclasses import dataclass, fields

import numpy as np

from models.errors import ShapeError
from models.geometry.rotation import (
    Array,
    angles_from_rotation,
    quaternion_from_rotation,
    rotation_from_angles,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraPose:
    """Pose in the world frame (metres, Z up, ground Z = 0), angles in radians.

    Raises:
        ShapeError: a number is not finite, the height is not above 0 or the tilt beyond +-90 deg.
    """

    height_m: float
    tilt_rad: float
    roll_rad: float = 0.0
    heading_rad: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise ShapeError(f"{field.name}: must be finite, got {value}")
        if self.height_m <= 0:
            raise ShapeError(f"height_m: must be above 0, got {self.height_m}")
        if abs(self.tilt_rad) > math.pi / 2 + 1e-9:
            raise ShapeError(f"tilt_rad: must be within +-pi/2, got {self.tilt_rad}")

    @property
    def rotation(self) -> Array:
        """Rotation `camera_from_world` (3, 3)."""
        return rotation_from_angles(self.tilt_rad, self.roll_rad, self.heading_rad)

    @property
    def quaternion_wxyz(self) -> Array:
        """Orientation `camera_from_world` (4,), w >= 0."""
        return quaternion_from_rotation(self.rotation)

    @property
    def centre_m(self) -> Array:
        """Centre of the camera in the world (3,)."""
        return np.array([self.x_m, self.y_m, self.height_m])

    @property
    def level_from_camera(self) -> Array:
        """Rotation (3, 3) from the camera frame to right, ahead, up; its heading is 0 there."""
        return np.asarray(rotation_from_angles(self.tilt_rad, self.roll_rad, 0.0).T)

    @property
    def translation_m(self) -> Array:
        """`t` of `x_camera = R x_world + t` (3,); never the height."""
        return np.asarray(-self.rotation @ self.centre_m)


def pose_from_matrices(rotation: Array, translation_m: Array) -> CameraPose:
    """The pose of `x_camera = R x_world + t`; the height is `C[2]` of `C = -R.T t`."""
    return pose_from_centre(rotation, -rotation.T @ translation_m)


def pose_from_centre(rotation: Array, centre_m: Array) -> CameraPose:
    """The pose of a rotation `camera_from_world` (3, 3) at a centre (3,) in the world."""
    tilt, roll, heading = angles_from_rotation(rotation)
    return CameraPose(
        height_m=float(centre_m[2]),
        tilt_rad=float(tilt),
        roll_rad=float(roll),
        heading_rad=float(heading),
        x_m=float(centre_m[0]),
        y_m=float(centre_m[1]),
    )
