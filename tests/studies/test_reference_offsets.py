"""The offset of an estimator on a site, taken off by its reference."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.pose import CameraPose, plane_parameters_of
from studies.plane_estimate import PlaneEstimate
from studies.protocol.regressors import SITE_BIAS_SD, without_offset

PRIOR = CameraPose(height_m=5, tilt_rad=0.2, roll_rad=-0.05)


def estimate(values: object, sd: float, tracks: int = 50) -> PlaneEstimate:
    return PlaneEstimate(
        values=np.asarray(values, float), covariance=sd**2 * np.eye(3), tracks=tracks
    )


def test_a_sure_reference_takes_its_whole_offset_off():
    offset = np.array([0.02, -0.03, 0.1])
    drift = np.array([0.1, 0.05, -0.2])
    seen = estimate(plane_parameters_of(PRIOR) + drift + offset, 0.01)
    left = without_offset(seen, estimate(plane_parameters_of(PRIOR) + offset, 1e-6), PRIOR)
    assert_allclose(left.values, plane_parameters_of(PRIOR) + drift, atol=1e-7)
    assert_allclose(left.covariance, seen.covariance, atol=1e-9)
    assert left.tracks == 50


def test_a_reference_that_knows_nothing_takes_nothing_off_and_says_so():
    seen = estimate(plane_parameters_of(PRIOR) + 0.05, 0.01)
    left = without_offset(seen, estimate(plane_parameters_of(PRIOR) + 0.3, 100.0), PRIOR)
    assert_allclose(left.values, seen.values, atol=1e-5)
    assert_allclose(np.diag(left.covariance), 0.01**2 + np.square(SITE_BIAS_SD), rtol=1e-3)


def test_as_sure_of_the_offset_as_of_the_bias_takes_half_off():
    sd = SITE_BIAS_SD[2]
    reference = estimate(plane_parameters_of(PRIOR) + [0, 0, 0.1], sd)
    left = without_offset(estimate(plane_parameters_of(PRIOR), 0.01), reference, PRIOR)
    assert left.values[2] == pytest.approx(math.log(5) - 0.05)
    assert left.covariance[2, 2] == pytest.approx(0.01**2 + sd**2 / 2)
