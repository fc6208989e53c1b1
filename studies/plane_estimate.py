"""An answer of any estimator about the ground plane before a camera, as a value."""

from dataclasses import dataclass

import numpy as np

from models.errors import ShapeError
from models.geometry.rotation import Array


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
