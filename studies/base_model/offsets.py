"""Moves of a camera in its level frame: right, ahead and up as it believes them, heading 0.

In it cameras look alike: a move is a small turn of the plumb line and a change of the log height,
whatever the lens and the tilt. Numpy only.
"""

import math
from dataclasses import replace

import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, rotation_from_angles


def offset_between(believed: CameraPose, true: CameraPose) -> Array:
    """Lean (3,) of a camera ahead and to its right, and the log of its height.

    Of a true pose from a believed one, in radians about the latter's level axes. For a camera
    without roll the first is the change of its tilt; the second is its roll times the cosine of its
    tilt, about. Headings say nothing.
    """
    up = believed.level_from_camera @ _up_seen(true.tilt_rad, true.roll_rad)
    return np.array(
        [
            -math.atan2(up[1], up[2]),
            -math.atan2(up[0], up[2]),
            math.log(true.height_m / believed.height_m),
        ]
    )


def moved_by(believed: CameraPose, offset: Array) -> CameraPose:
    """The pose that is an offset (3,) away; `offset_between` turned about.

    Tilts beyond the vertical are kept at it; x, y and heading stay.
    """
    lean = -np.tan(np.clip(offset[:2], -1.4, 1.4))
    up = np.array([lean[1], lean[0], 1.0])
    seen = believed.level_from_camera.T @ (up / np.linalg.norm(up))
    return replace(
        believed,
        height_m=believed.height_m * math.exp(float(offset[2])),
        tilt_rad=math.asin(float(np.clip(-seen[2], -1.0, 1.0))),
        roll_rad=math.atan2(-float(seen[0]), -float(seen[1])),
    )


def _up_seen(tilt_rad: float, roll_rad: float) -> Array:
    """The direction (3,) to the zenith in the camera frame."""
    return np.asarray(rotation_from_angles(tilt_rad, roll_rad, 0.0)[:, 2])
