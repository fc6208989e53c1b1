"""A heading is the same one turn further on: by hand, in all that compares two poses."""

import math

import numpy as np
import pytest

from models.geometry.pose import PARAMETERS, parameters_apart
from models.paths.registration import Peak, distinct
from models.pose.change_point import moved_beyond_doubt
from models.pose.modes import covariance_between
from models.pose.pose_fit import FusedEstimate


def at(heading_deg, roll_deg=0.0):
    return np.array([1.4, math.radians(roll_deg), 1.6, math.radians(heading_deg)])


def peak(heading_deg, value=0.0):
    return Peak(candidate=at(heading_deg), value=value)


def estimate(heading_deg):
    return FusedEstimate(
        values=at(heading_deg),
        covariance=np.eye(4) * 1e-4,
        identifiable=PARAMETERS,
        reason=None,
    )


def test_poses_are_apart_by_half_a_turn_at_most():
    apart = np.degrees(parameters_apart(at(179, roll_deg=-175), at(-179, roll_deg=175)))
    np.testing.assert_allclose(apart, [0, 10, 0, -2], atol=1e-9)
    whole = parameters_apart(np.array([0.1, 0.0, 9.0, 0.0]), np.zeros(4))
    np.testing.assert_allclose(whole, [0.1, 0, 9, 0])  # a log height has no turns


def test_a_mode_that_was_found_both_ways_round_is_one():
    kept = distinct([peak(-180.1, value=1.0), peak(179.9, value=2.0), peak(90.0, value=0.5)])
    assert [each.value for each in kept] == [2.0, 0.5]


def test_modes_across_the_cut_are_as_near_as_they_are():
    across = covariance_between([peak(176), peak(-179)], np.ones(2))
    assert math.degrees(math.sqrt(across[3, 3])) == pytest.approx(5 / math.sqrt(2))


def test_a_camera_has_not_moved_by_a_whole_turn():
    assert not moved_beyond_doubt(estimate(179.9), 30, estimate(-180.1), 30)
    assert moved_beyond_doubt(estimate(170.0), 30, estimate(-170.0), 30)
