"""The offset of a trained regressor at a site, taken off by a reference at the prior pose."""

import math

import numpy as np

from models.geometry.plane_parameters import PlaneEstimate, plane_parameters_of
from models.geometry.pose import CameraPose

# How far an estimator is usually off on a site for good: foot points, places of other speed.
SITE_BIAS_SD = (math.radians(1.5), math.radians(2.0), 0.15)


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
