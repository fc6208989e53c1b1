import math

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS, PoseParameters, array_of
from tests.strategies import poses

SOME = PoseParameters(height_m=5.0, tilt_rad=0.3, roll_rad=-0.02, heading_rad=1.1)


def test_the_order_of_arrays_and_the_log_of_the_height():
    assert_allclose(array_of(SOME), [0.3, -0.02, 1.6094379, 1.1], atol=1e-7)
    assert [SOME.of(name) for name in PARAMETERS] == [0.3, -0.02, 5.0, 1.1]


@given(poses())
def test_there_and_back(pose: CameraPose):
    back = PoseParameters.of_array(array_of(pose))
    for name in PARAMETERS:
        assert back.of(name) == pytest.approx(PoseParameters.of_pose(pose).of(name), rel=1e-12)


def test_three_numbers_leave_the_heading_as_it_is_said():
    found = PoseParameters.of_array(array_of(SOME)[:3], heading_rad=0.7)
    assert (found.heading_rad, found.tilt_rad) == (0.7, 0.3)


def test_the_deviation_of_a_log_is_one_of_metres():
    covariance = np.diag(np.square([0.01, 0.02, 0.03, 0.04]))
    sd = PoseParameters.sd_of_array(covariance, height_m=5.0)
    drawn = np.exp(math.log(5.0) + np.random.default_rng(0).normal(0, 0.03, 20_000))
    assert sd.height_m == pytest.approx(0.15)
    assert float(drawn.std()) == pytest.approx(sd.height_m, rel=0.03)
    assert (sd.tilt_rad, sd.roll_rad, sd.heading_rad) == pytest.approx((0.01, 0.02, 0.04))
