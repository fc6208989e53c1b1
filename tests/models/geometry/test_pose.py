import math
from dataclasses import replace
from math import inf, nan, pi, radians

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.geometry.pose import (
    PARAMETERS,
    CameraPose,
    PoseParameters,
    array_of,
    pose_from_centre,
    pose_from_matrices,
)
from models.geometry.rotation import angle_between
from tests.strategies import poses


def test_translation_of_a_camera_that_looks_east_and_down() -> None:
    # Rows right (0, -1, 0), down (-.5, 0, -.866), forward (.866, 0, -.5); centre (2, -1, 5).
    pose = CameraPose(
        height_m=5, tilt_rad=radians(30), heading_rad=radians(90), x_m=2, y_m=-1
    )  # fmt: skip
    assert_allclose(pose.translation_m, [-1, 5.3301270, 0.7679492], atol=1e-7)
    assert_allclose(pose.centre_m, [2, -1, 5])


@given(poses())
def test_matrices_round_trip(pose: CameraPose) -> None:
    back = pose_from_matrices(pose.rotation, pose.translation_m)
    assert_allclose(back.centre_m, pose.centre_m, atol=1e-9)
    assert angle_between(back.quaternion_wxyz, pose.quaternion_wxyz) < 1e-7
    assert back.tilt_rad == pytest.approx(pose.tilt_rad, abs=1e-7)


@given(poses())
def test_centre_round_trip(pose: CameraPose) -> None:
    back = pose_from_centre(pose.rotation, pose.centre_m)
    assert_allclose(back.rotation, pose.rotation, atol=1e-9)
    assert (back.height_m, back.x_m, back.y_m) == (pose.height_m, pose.x_m, pose.y_m)


def test_a_centre_below_the_ground_is_refused() -> None:
    with pytest.raises(ShapeError, match=r"height_m.*-2"):
        pose_from_centre(np.eye(3), np.array([0.0, 0, -2]))


@pytest.mark.parametrize("field", ["height_m", "tilt_rad", "roll_rad", "heading_rad", "x_m", "y_m"])
@pytest.mark.parametrize("value", [nan, inf])
def test_a_number_that_is_not_finite_is_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(ShapeError, match=field):
        replace(CameraPose(height_m=5, tilt_rad=0.3), **{field: value})


@pytest.mark.parametrize("height_m", [0.0, -1.0])
def test_a_height_not_above_the_ground_is_refused(height_m: float) -> None:
    with pytest.raises(ShapeError, match="height_m"):
        CameraPose(height_m=height_m, tilt_rad=0.3)


def test_tilt_reaches_straight_down_and_up_and_no_farther() -> None:
    assert_allclose(CameraPose(height_m=1, tilt_rad=pi / 2).rotation[2], [0, 0, -1], atol=1e-12)
    assert_allclose(CameraPose(height_m=1, tilt_rad=-pi / 2).rotation[2], [0, 0, 1], atol=1e-12)
    with pytest.raises(ShapeError, match="tilt_rad"):
        CameraPose(height_m=1, tilt_rad=radians(91))


SOME = PoseParameters(height_m=5.0, tilt_rad=0.3, roll_rad=-0.02, heading_rad=1.1)


def test_the_order_of_arrays_and_the_log_of_the_height():
    assert_allclose(array_of(SOME), [0.3, -0.02, 1.6094379, 1.1], atol=1e-7)
    assert [SOME.of(name) for name in PARAMETERS] == [0.3, -0.02, 5.0, 1.1]


@given(poses())
def test_there_and_back(pose: CameraPose):
    back = PoseParameters.of_array(array_of(pose))
    for name in PARAMETERS:
        assert back.of(name) == pytest.approx(PoseParameters.of_pose(pose).of(name), rel=1e-12)


def test_three_numbers_say_nothing_of_the_heading():
    found = PoseParameters.of_array(array_of(SOME)[:3])
    assert (found.heading_rad, found.tilt_rad) == (0.0, 0.3)


def test_the_deviation_of_a_log_is_one_of_metres():
    covariance = np.diag(np.square([0.01, 0.02, 0.03, 0.04]))
    sd = PoseParameters.sd_of_array(covariance, height_m=5.0)
    drawn = np.exp(math.log(5.0) + np.random.default_rng(0).normal(0, 0.03, 20_000))
    assert sd.height_m == pytest.approx(0.15)
    assert float(drawn.std()) == pytest.approx(sd.height_m, rel=0.03)
    assert (sd.tilt_rad, sd.roll_rad, sd.heading_rad) == pytest.approx((0.01, 0.02, 0.04))
