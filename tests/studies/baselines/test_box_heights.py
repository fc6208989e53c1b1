"""cameratransform by statures: exact of ideal heads, whatever our signs and its own are."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from models.errors import ShapeError, TooFewTrajectoriesError
from studies.baselines.box_heights import Statures, pose_by_box_heights
from tests.studies.baselines.test_vanishing_points import CROWD, LENS, POSE

PRIOR = replace(
    POSE, tilt_rad=POSE.tilt_rad + 0.08, roll_rad=POSE.roll_rad - 0.06, height_m=1.1 * POSE.height_m
)


def test_ideal_heads_of_known_statures_are_the_pose():
    pytest.importorskip("cameratransform", reason="surefoot[peers] is not installed")
    found = pose_by_box_heights(LENS, CROWD, PRIOR, Statures(mean_m=1.7, sd_m=0.05))
    assert np.degrees(found.values[:2]) == pytest.approx([25, 4], abs=0.05)
    assert math.exp(found.values[2]) == pytest.approx(6.0, rel=0.002)
    # 110 places, each 3 % of a stature: its own likelihood is sure to within a degree.
    assert (np.sqrt(np.diag(found.covariance)) < [0.02, 0.02, 0.02]).all()


def test_who_has_no_box_is_refused():
    pytest.importorskip("cameratransform", reason="surefoot[peers] is not installed")
    with pytest.raises(TooFewTrajectoriesError, match="10 points with a box or a head"):
        pose_by_box_heights(LENS, [replace(CROWD[0], head_uv=None)], PRIOR)


def test_without_it_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "cameratransform", None)
    with pytest.raises(ShapeError, match="surefoot\\[peers\\]"):
        pose_by_box_heights(LENS, CROWD, PRIOR)
