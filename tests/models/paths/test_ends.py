"""Modes that are none, and what is added for flat ones."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from models.pose.modes import covariance_beyond_gaussian, not_far_above


def end(height_m):
    return SimpleNamespace(candidate=np.array([0.3, 0.0, math.log(height_m), 0.1]))


def test_a_camera_twice_as_high_as_speeds_say_is_no_end_unless_there_are_no_others():
    usual, higher, absurd, low = end(6.0), end(11.0), end(15.0), end(2.5)
    assert not_far_above([absurd, usual, higher, low], math.log(6.0)) == [usual, higher]
    assert not_far_above([absurd, low], math.log(6.0)) == [absurd, low]


def spread(asked, sd):
    """An end whose posterior is a Gaussian of heading of a standard deviation, in radians."""

    def values(candidates):
        asked.append(candidates)
        return -0.5 * ((candidates[:, 3] - 0.1) / sd) ** 2

    return SimpleNamespace(
        candidate=np.array([0.3, 0.0, math.log(6.0), 0.1]), posterior=SimpleNamespace(values=values)
    )


def test_a_posterior_that_is_twice_as_wide_as_its_peak_says_adds_the_difference():
    covariance = np.diag([0.01, 0.01, 0.01, 0.04])
    covariance[2, 3] = covariance[3, 2] = 0.01
    assert np.abs(covariance_beyond_gaussian(spread([], 0.2), covariance)).max() < 1e-7
    added = covariance_beyond_gaussian(spread([], 0.4), covariance)
    # Of t = -4 .. 4 weighed by exp(-t^2 / 8) the mean of t^2 is 16.792 / 4.898 = 3.4285.
    assert added[3, 3] == pytest.approx(2.4285 * 0.04, rel=1e-3)
    assert added[2, 3] == pytest.approx(added[3, 3] / 4)
    assert (added[:2] == 0).all()


def test_where_nothing_is_known_no_height_beyond_all_numbers_is_asked_for():
    covariance = np.diag([0.01, 0.01, 1e6, 0.04])
    covariance[2, 3] = covariance[3, 2] = 100.0  # 2,500 for each radian: exp(2,000) is no number
    asked = []
    assert (covariance_beyond_gaussian(spread(asked, 0.2), covariance) == 0).all()
    assert not asked
