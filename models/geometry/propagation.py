"""The error of a pose carried over to points: to the first order, through numeric derivatives.

Near the horizon the ground is not linear in the pose: there ellipses are a lower bound.
"""

from collections.abc import Callable

import numpy as np

from models.geometry.pose import PARAMETERS, CameraPose, array_of
from models.geometry.rotation import Array, rotation_from_angles

# Of radians and log height: the error of a central difference is its square, 1e-10 of the value.
_STEP = 1e-5
# Points (N, 2) by a rotation `camera_from_world` (3, 3) and a height in metres; NaN where none is.
Placed = Callable[[Array, float], Array]


def error_ellipses(placed: Placed, pose: CameraPose, covariance: Array) -> Array:
    """One-sd ellipses (N, 3) of points: both semi-axes, the major first, and its angle in radians.

    The angle is from the first axis towards the second, in (-pi/2, pi/2]; 39 % of a Gaussian are
    within one sd, 95 % within 2.45.

    `placed` gives the points of a pose, whose x and y are known; `covariance` (4, 4) is of its
    tilt, roll, log height, heading.

    Source: Hartley and Zisserman, "Multiple View Geometry", 2nd edition, result 5.6.
    """
    at = array_of(pose)
    steps = _STEP * np.eye(len(PARAMETERS))
    columns = [_at(placed, at + step) - _at(placed, at - step) for step in steps]
    derivatives = np.stack(columns, axis=-1) / (2 * _STEP)  # (N, 2, 4)
    spread = derivatives @ covariance @ np.swapaxes(derivatives, -1, -2)  # result 5.6
    first, second, both = spread[:, 0, 0], spread[:, 1, 1], spread[:, 0, 1]
    mean, apart = (first + second) / 2, np.hypot((first - second) / 2, both)
    axes = [np.sqrt(mean + apart), np.sqrt(np.maximum(mean - apart, 0.0))]
    return np.stack([*axes, np.arctan2(both, (first - second) / 2) / 2], axis=-1)


def _at(placed: Placed, values: Array) -> Array:
    tilt, roll, log_height, heading = values
    return placed(rotation_from_angles(tilt, roll, heading), float(np.exp(log_height)))
