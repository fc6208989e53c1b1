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
# How far an estimator is usually off on a site for good: foot points, places of other speed.
SITE_BIAS_SD = (math.radians(1.5), math.radians(2.0), 0.15)


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


def without_offset(
    estimate: PlaneEstimate, reference: PlaneEstimate, prior: CameraPose
) -> PlaneEstimate:
    """The estimate less what the estimator was off while the pose was known to be the prior.

    The offset is `reference - prior`, shrunk by its own uncertainty: of a reference that knows
    nothing nothing is taken off. What stays unknown of it is added to the covariance.
    """
    bias = np.diag(np.square(SITE_BIAS_SD))
    gain = bias @ np.linalg.inv(bias + reference.covariance)
    offset = gain @ (reference.values - plane_parameters_of(prior))
    left = bias - gain @ bias
    return PlaneEstimate(
        values=estimate.values - offset,
        covariance=estimate.covariance + (left + left.T) / 2,
        tracks=estimate.tracks,
    )
