"""The pose that a camera is taken for before anybody was seen: how installers hang cameras.

Level, at a pole's or a ceiling's height, and looking down by anything. The numbers are ours.
"""

import math
from collections.abc import Mapping

import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_HEIGHT_M, _TILT_RAD = 4.5, math.radians(25.0)
# Of tilt, roll (radians) and log height: unmeasured, and by a sensor, a level, a tape.
_SD = np.array([math.radians(30.0), math.radians(2.5), 0.6])
_MEASURED_SD = np.array([math.radians(1.0), math.radians(1.0), 0.05])
# More is of no use: nobody should agree to it.
CONFIRMABLE_SD = np.array([math.radians(4.0), math.radians(4.0), 0.3])
MEASURABLE = ("tilt_rad", "roll_rad", "height_m")  # in the order of the three


def usual_pose(measured: Mapping[str, float]) -> CameraPose:
    """The pose with what was measured of tilt and roll in radians and the height in metres."""
    usual = {"height_m": _HEIGHT_M, "tilt_rad": _TILT_RAD, "roll_rad": 0.0}
    return CameraPose(**(usual | dict(measured)))


def measured_precision(measured: Mapping[str, float]) -> Array:
    """Inverse covariance (3, 3) of the measured tilt, roll and log height, 0 where not measured."""
    return np.diag([name in measured for name in MEASURABLE] * _MEASURED_SD**-2.0)


def usual_sd(measured: Mapping[str, float]) -> Array:
    """Standard deviations (3,) of that pose's tilt, roll (radians) and log height."""
    return np.where([name in measured for name in MEASURABLE], _MEASURED_SD, _SD)
