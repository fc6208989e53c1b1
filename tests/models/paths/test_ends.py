"""Modes that are none."""

import math
from types import SimpleNamespace

import numpy as np

from models.pose.modes import not_far_above


def end(height_m):
    return SimpleNamespace(candidate=np.array([0.3, 0.0, math.log(height_m), 0.1]))


def test_a_camera_twice_as_high_as_speeds_say_is_no_end_unless_there_are_no_others():
    usual, higher, absurd, low = end(6.0), end(11.0), end(15.0), end(2.5)
    assert not_far_above([absurd, usual, higher, low], math.log(6.0)) == [usual, higher]
    assert not_far_above([absurd, low], math.log(6.0)) == [absurd, low]
