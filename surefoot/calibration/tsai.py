"""Tsai's camera as the XML of PETS 2009: in millimetres, with a lens that undistorts.

Source: Tsai 1987, "A Versatile Camera Calibration Technique"; the XML of PETS 2009.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from models.geometry.rotation import rotation_from_vector
from surefoot.calibration.fields import field_numbers
from surefoot.calibration.value import Calibration, CalibrationFileError

_PARTS = ("Geometry", "Intrinsic", "Extrinsic")
_M = 1e-3  # of a millimetre
_RADII = 256
_MOST_OFF_PX = 0.5  # of three coefficients, in the image


def is_tsai(document: Mapping[str, Any]) -> bool:
    """True of a camera with Tsai's three parts."""
    return all(isinstance(document.get(part), Mapping) for part in _PARTS)


def read_tsai(document: Mapping[str, Any]) -> Calibration:
    """The lens in OpenCV's terms, and the pose in metres.

    Raises:
        CalibrationFileError: a number is missing, or the distortion has no inverse in the image.
    """
    geometry, intrinsic, extrinsic = (document[part] for part in _PARTS)
    width, height = _number(geometry, "width"), _number(geometry, "height")
    focal = _number(intrinsic, "focal")
    fx = focal * _number(intrinsic, "sx") / _number(geometry, "dpx")
    fy = focal / _number(geometry, "dpy")
    cx, cy = _number(intrinsic, "cx"), _number(intrinsic, "cy")
    corner = math.hypot(max(cx, width - cx) / fx, max(cy, height - cy) / fy)
    k1, k2, k3 = _inverse(_number(intrinsic, "kappa1") * focal**2, corner, max(fx, fy))
    turns = [
        _number(extrinsic, name) * axis
        for name, axis in zip(("rx", "ry", "rz"), np.eye(3), strict=True)
    ]
    by_x, by_y, by_z = map(rotation_from_vector, turns)
    return Calibration(
        format="Tsai XML",
        size=(round(width), round(height)),
        matrix=(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0),
        distortion=(k1, k2, 0.0, 0.0, k3),
        rotation=tuple((by_z @ by_y @ by_x).ravel().tolist()),
        translation_m=tuple(_M * _number(extrinsic, name) for name in ("tx", "ty", "tz")),
    )


def _number(part: Mapping[str, Any], name: str) -> float:
    found = field_numbers(part, (name,), (1,))
    if not found:
        raise CalibrationFileError(f"{name}: is required")
    return found[0]


def _inverse(kappa: float, corner: float, focal_px: float) -> list[float]:
    """k1, k2, k3 that distort as r_undistorted = r (1 + kappa r^2) undistorts, up to a radius."""
    bent = np.linspace(0, corner, _RADII)
    straight = bent * (1 + kappa * bent**2)
    if (np.diff(straight) <= 0).any():
        raise CalibrationFileError(
            f"kappa1: must not fold back within the image (got {kappa:.3g} per focal length "
            "squared)"
        )
    design = np.column_stack([straight**power for power in (3, 5, 7)])
    found, *_ = np.linalg.lstsq(design, bent - straight, rcond=None)
    off_px = float(np.abs(design @ found - (bent - straight)).max()) * focal_px
    if off_px > _MOST_OFF_PX:
        raise CalibrationFileError(
            f"kappa1: must be within {_MOST_OFF_PX:g} px of k1, k2, k3 (got {off_px:.2g} px)"
        )
    return [float(each) for each in found]
