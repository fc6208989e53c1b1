"""The parameters of a pose that people can show, as one value: height, tilt, roll and heading.

The one place where they become arrays and come back. Arrays, which the numerics of `joint/` and
`flow/` work on, are in the order of `PARAMETERS`, the height as its log.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

PARAMETERS = ("tilt", "roll", "height", "heading")
_FIELDS = {"tilt": "tilt_rad", "roll": "roll_rad", "height": "height_m", "heading": "heading_rad"}


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
        return float(getattr(self, _FIELDS[name]))

    def __composite_values__(self) -> tuple[float, float, float, float]:
        """The values in the order of the fields, as the store keeps them."""
        return self.height_m, self.tilt_rad, self.roll_rad, self.heading_rad

    @classmethod
    def of_pose(cls, pose: CameraPose) -> Self:
        """Those of a pose."""
        return cls(
            height_m=pose.height_m,
            tilt_rad=pose.tilt_rad,
            roll_rad=pose.roll_rad,
            heading_rad=pose.heading_rad,
        )

    @classmethod
    def of_array(cls, values: Array, heading_rad: float = 0.0) -> Self:
        """Those of tilt, roll, log height (3,), or of these and the heading (4,)."""
        tilt, roll, log_height, *heading = (float(value) for value in values)
        return cls(
            height_m=math.exp(log_height),
            tilt_rad=tilt,
            roll_rad=roll,
            heading_rad=heading[0] if heading else heading_rad,
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
