import math
from dataclasses import replace

import pytest

from models.drift.verdict import DriftLimits, drift_between, judge
from models.estimation.averaged import PoseEstimate
from models.geometry.pose import CameraPose

PRIOR = CameraPose(height_m=6.0, tilt_rad=0.4, roll_rad=math.radians(179), heading_rad=2.0)
LIMITS = DriftLimits(sigmas=4.0, floor_rad=math.radians(2), floor_m=0.5, updates=3, clear_ratio=0.7)
STILL = PoseEstimate(
    height_m=6.0,
    tilt_rad=0.4,
    roll_rad=math.radians(179),
    heading_rad=2.0,
    height_sd_m=0.01,
    tilt_sd_rad=0.001,
    roll_sd_rad=0.001,
    tracks=100,
)


def verdicts(estimates, drifting=False):
    streak, out = 0, []
    for estimate in estimates:
        verdict = judge(drift_between(estimate, PRIOR), estimate, LIMITS, streak, drifting)
        streak, drifting = verdict.streak, verdict.drifting
        out.append(drifting)
    return out


def tilted(degrees, sd_deg=0.05):
    return replace(STILL, tilt_rad=0.4 + math.radians(degrees), tilt_sd_rad=math.radians(sd_deg))


def test_drift_is_signed_and_roll_goes_round():
    moved = replace(STILL, tilt_rad=0.3, roll_rad=math.radians(-178), height_m=5.0)
    drift = drift_between(moved, PRIOR)
    assert drift.height_m == -1.0
    assert drift.tilt_rad == pytest.approx(-0.1)
    assert drift.roll_rad == pytest.approx(math.radians(3))
    assert drift.angle_rad == pytest.approx(math.hypot(0.1, math.radians(3)), rel=0.01)


def test_the_heading_of_an_estimate_is_no_drift():
    assert drift_between(replace(STILL, heading_rad=1.0), PRIOR).angle_rad == pytest.approx(0)


def test_a_single_update_beyond_the_limits_is_no_drift():
    assert verdicts([tilted(5), STILL, tilted(5), tilted(5), STILL]) == [False] * 5


def test_three_in_a_row_are():
    assert verdicts([tilted(5)] * 4) == [False, False, True, True]
    assert verdicts([tilted(-5)] * 3)[-1]
    assert verdicts([replace(STILL, height_m=5.4)] * 3)[-1]


def test_the_larger_of_floor_and_sd_counts():
    assert not any(verdicts([tilted(1.9)] * 5))
    assert not any(verdicts([tilted(5, sd_deg=1.5)] * 5))
    assert verdicts([tilted(6.1, sd_deg=1.5)] * 3)[-1]


def test_it_clears_below_a_share_of_the_limits_only():
    assert verdicts([tilted(1.7)] * 6, drifting=True) == [True] * 6
    assert verdicts([tilted(1.3)] * 3, drifting=True) == [True, True, False]
    assert verdicts([tilted(1.3), tilted(1.7), tilted(1.3), tilted(1.3)], drifting=True)[-1]
