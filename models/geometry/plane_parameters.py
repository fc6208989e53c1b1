"""Tilt, roll and log height with their covariance, and what a reference takes off them."""

import math
from dataclasses import dataclass

import numpy as np

from models.errors import ShapeError
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS, array_of
from models.geometry.rotation import Array

# By name, in the order of every (3,).
PLANE_PARAMETERS = PARAMETERS[:3]  # of the ground plane before the camera: speeds determine these
ANGLES = ("tilt", "roll", "heading")
# A parameter whose standard deviation is larger is not identifiable; in the order of WITH_HEADING.
IDENTIFIABLE_SD = np.array([math.radians(2.0), math.radians(2.0), 0.12, math.radians(2.0)])


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneEstimate:
    """Tilt, roll (radians) and log height: values (3,), covariance (3, 3), from so many tracks.

    Raises:
        ShapeError: an array of another shape, or a parameter that is not finite.
    """

    values: Array
    covariance: Array
    tracks: int

    def __post_init__(self) -> None:
        if self.values.shape != (3,) or self.covariance.shape != (3, 3):
            raise ShapeError(
                f"values, covariance: (3,) and (3, 3) are needed, got {self.values.shape} and "
                f"{self.covariance.shape}"
            )
        if not (np.isfinite(self.values).all() and np.isfinite(self.covariance).all()):
            raise ShapeError("values, covariance: must be finite")


def identifiable_of(names: tuple[str, ...], sd: Array) -> tuple[str, ...]:
    """Those of the named parameters (N,), in the order of `sd` (N,), that the data determine."""
    most = IDENTIFIABLE_SD[: len(names)]
    return tuple(name for name, known in zip(names, sd <= most, strict=True) if known)


def plane_parameters_of(pose: CameraPose) -> Array:
    """Tilt, roll (radians) and log height (3,) of a pose."""
    return array_of(pose)[:3]
