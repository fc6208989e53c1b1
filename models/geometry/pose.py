"""The pose of a fixed camera, as a value, and those of its parameters that people can show.

Arrays, which the numerics work on, are in the order of `PARAMETERS`, the height as its log; this is
the one place where poses become arrays and come back.
"""

import math
from dataclasses import dataclass, fields
from typing import Self

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

    @classmethod
    def of_degrees(
        cls,
        *,
        height_m: float,
        tilt_deg: float,
        roll_deg: float = 0.0,
        heading_deg: float = 0.0,
        x_m: float = 0.0,
        y_m: float = 0.0,
    ) -> Self:
        """The pose of angles in degrees, as HTTP, files and pages have them.

        Raises:
            ShapeError: as of the pose itself.
        """
        return cls(
            height_m=height_m,
            tilt_rad=math.radians(tilt_deg),
            roll_rad=math.radians(roll_deg),
            heading_rad=math.radians(heading_deg),
            x_m=x_m,
            y_m=y_m,
        )

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


PARAMETERS = ("tilt", "roll", "height", "heading")
FIELDS = {"tilt": "tilt_rad", "roll": "roll_rad", "height": "height_m", "heading": "heading_rad"}


def parameters_apart(one: Array, other: Array) -> Array:
    """Tilt, roll, log height, heading (4,) less another's; roll and heading within half a turn."""
    apart = one - other
    apart[[1, 3]] = [math.remainder(angle, 2 * math.pi) for angle in apart[[1, 3]].tolist()]
    return np.asarray(apart)


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseParameters:
    """Height, tilt, roll and heading of a pose, their standard deviations, or how far they moved.

    Which of them are identifiable is said beside it.
    """

    height_m: float
    tilt_rad: float
    roll_rad: float
    heading_rad: float

    def of(self, name: str) -> float:
        """A parameter by its name: in metres for height, else in radians."""
        return float(getattr(self, FIELDS[name]))

    def __composite_values__(self) -> tuple[float, float, float, float]:
        """The values in the order of the fields, as the store keeps them."""
        return self.height_m, self.tilt_rad, self.roll_rad, self.heading_rad

    @classmethod
    def of_pose(cls, pose: CameraPose) -> Self:
        """Those of a pose."""
        return cls(**{field: getattr(pose, field) for field in FIELDS.values()})

    @classmethod
    def of_array(cls, values: Array) -> Self:
        """Those of tilt, roll, log height (3,), or of these and the heading (4,)."""
        tilt, roll, log_height, *heading = (float(value) for value in values)
        return cls(
            height_m=math.exp(log_height),
            tilt_rad=tilt,
            roll_rad=roll,
            heading_rad=heading[0] if heading else 0.0,
        )

    @classmethod
    def sd_of_array(cls, covariance: Array, height_m: float) -> Self:
        """Standard deviations by a covariance (4, 4) of tilt, roll, log height, heading.

        The height's is in proportion to the height that the log is of.
        """
        tilt, roll, log_height, heading = map(float, np.sqrt(np.diag(covariance)))
        return cls(
            height_m=height_m * log_height, tilt_rad=tilt, roll_rad=roll, heading_rad=heading
        )


def array_of(parameters: PoseParameters | CameraPose) -> Array:
    """Tilt, roll (radians), log height and heading (radians) (4,)."""
    p = parameters
    return np.array([p.tilt_rad, p.roll_rad, math.log(p.height_m), p.heading_rad])


# By name, in the order of every (3,).
PLANE_PARAMETERS = PARAMETERS[:3]  # of the ground plane before the camera: speeds determine these
ANGLES = ("tilt", "roll", "heading")
# A parameter whose standard deviation is larger is not identifiable; in the order of WITH_HEADING.
IDENTIFIABLE_SD = np.array([math.radians(2.0), math.radians(2.0), 0.12, math.radians(2.0)])


def identifiable_of(names: tuple[str, ...], sd: Array) -> tuple[str, ...]:
    """Those of the named parameters (N,), in the order of `sd` (N,), that the data determine."""
    most = IDENTIFIABLE_SD[: len(names)]
    return tuple(name for name, known in zip(names, sd <= most, strict=True) if known)


def plane_parameters_of(pose: CameraPose) -> Array:
    """Tilt, roll (radians) and log height (3,) of a pose."""
    return array_of(pose)[:3]
