import math
from dataclasses import replace

import numpy as np
import pytest

from models.assessment import judge, may_be_alerted
from models.assessment.scale_faults import clock_fault
from models.geometry.pose import PARAMETERS, CameraPose, PoseParameters
from models.monitoring.chart import ChartResult
from models.monitoring.drift import (
    DriftLimits,
    MoveProbabilities,
    drift_between,
    pose_after,
    served_error,
)
from models.monitoring.slow_drift import SlowDrift
from models.reasons import TracksCode

PRIOR = CameraPose(height_m=6.0, tilt_rad=0.4, roll_rad=math.radians(179), heading_rad=2.0)
LIMITS = DriftLimits(
    certainty=0.99, floor_rad=math.radians(2), floor_m=0.5, people=12, clear_ratio=0.7
)
SURE = MoveProbabilities(moved=1.0, parameters=dict.fromkeys(PARAMETERS, 1.0))


THREE = ("tilt", "roll", "height")
FOUR = (*THREE, "heading")


def drift(
    tilt_deg=0.0,
    roll_deg=0.0,
    height_m=6.0,
    heading_deg=0.0,
    *,
    sd_deg=0.05,
    sd_log=0.002,
    unidentifiable=(),
    able=THREE,
    move=SURE,
):
    """A pose that is so far from the prior pose; without what is `unidentifiable`."""
    found = PoseParameters(
        height_m=height_m,
        tilt_rad=PRIOR.tilt_rad + math.radians(tilt_deg),
        roll_rad=PRIOR.roll_rad + math.radians(roll_deg),
        heading_rad=PRIOR.heading_rad + math.radians(heading_deg),
    )
    sd_rad = math.radians(sd_deg)
    sd = PoseParameters(
        height_m=height_m * sd_log, tilt_rad=sd_rad, roll_rad=sd_rad, heading_rad=sd_rad
    )
    identifiable = tuple(name for name in able if name not in unidentifiable)
    return drift_between(found, sd, identifiable, PRIOR, move)


def likely(moved, **parameters):
    """A move of such a probability, in these parameters."""
    shares = {name: parameters.get(name, 0.0) for name in PARAMETERS}
    return MoveProbabilities(moved=moved, parameters=shares)


def drifting(now, drifted=()):
    return judge(now, LIMITS, drifted).drifting


def test_the_floor_of_an_angle_is_one_of_the_whole_turn():
    """1.3 deg in each of two angles are 1.8 deg, below the floor of 2 deg; 1.6 deg are 2.3."""
    below, beyond = drift(tilt_deg=1.3, roll_deg=1.3), drift(tilt_deg=1.6, roll_deg=-1.5)
    assert math.degrees(beyond.angle_rad) == pytest.approx(math.hypot(1.6, 1.5), abs=0.01)
    assert not drifting(below)
    verdict = judge(beyond, LIMITS, ())
    assert verdict.drifted == ("tilt",)
    assert verdict.excess == pytest.approx(math.hypot(1.6, 1.5) / 2, abs=0.01)
    # It ends below 0.7 of the floor, by the whole turn again: 1.0 deg in both are 1.41.
    assert drifting(drift(tilt_deg=1.0, roll_deg=1.0), ("tilt",))
    assert not drifting(drift(tilt_deg=0.95, roll_deg=0.95), ("tilt",))


def test_drift_is_signed_and_roll_goes_round():
    values = np.array([0.3, math.radians(-178), math.log(5.0), 1.0])
    sd = PoseParameters.sd_of_array(np.eye(4) * 1e-6, 5.0)
    found = drift_between(PoseParameters.of_array(values), sd, THREE, PRIOR, SURE)
    assert found.by.height_m == pytest.approx(-1.0)
    assert found.by.tilt_rad == pytest.approx(-0.1)
    assert found.by.roll_rad == pytest.approx(math.radians(3))
    assert found.angle_rad == pytest.approx(math.hypot(0.1, math.radians(3)), rel=0.01)
    assert found.sd.height_m == pytest.approx(5e-3)


def test_what_is_not_told_stays_the_priors():
    found = drift(5.0, 3.0, 7.0, unidentifiable=("tilt", "height"))
    assert found.identifiable == ("roll",)
    served = pose_after(found, PRIOR)
    assert (served.tilt_rad, served.height_m) == (PRIOR.tilt_rad, PRIOR.height_m)
    assert found.angle_rad == pytest.approx(math.radians(3))
    assert served.heading_rad == PRIOR.heading_rad


def test_a_told_heading_is_a_drift_clockwise_positive():
    found = drift(heading_deg=5, able=FOUR)
    assert math.degrees(found.by.heading_rad) == pytest.approx(5)
    assert pose_after(found, PRIOR).heading_rad == pytest.approx(PRIOR.heading_rad + 0.0872665)
    assert math.degrees(found.angle_rad) == pytest.approx(5)
    verdict = judge(found, LIMITS, ())
    assert verdict.drifted == ("heading",)
    assert verdict.excess == pytest.approx(2.5)
    panned = drift(heading_deg=5)  # not told: a drift that nobody can say the size of
    assert (panned.angle_rad, judge(panned, LIMITS, ()).drifted) == (0.0, ("heading",))
    assert pose_after(panned, PRIOR).heading_rad == PRIOR.heading_rad


@pytest.mark.parametrize(("prior_deg", "served_deg"), [(40, 45), (359, 4), (-358, -353), (360, 5)])
def test_a_heading_goes_round(prior_deg, served_deg):
    prior = replace(PRIOR, heading_rad=math.radians(prior_deg))
    whole = round(prior_deg / 360) * 360  # as an estimator may see it
    values = np.array([0.4, prior.roll_rad, math.log(6), math.radians(prior_deg + 5 - whole)])
    sd = PoseParameters.sd_of_array(np.eye(4) * 1e-6, 6.0)
    found = drift_between(PoseParameters.of_array(values), sd, FOUR, prior, SURE)
    assert math.degrees(found.by.heading_rad) == pytest.approx(5)
    assert math.degrees(pose_after(found, prior).heading_rad) == pytest.approx(served_deg)


def test_a_drift_is_certain_and_beyond_its_floor():
    assert drifting(drift(2.1))
    assert drifting(drift(-2.1))
    assert drifting(drift(height_m=5.4))
    assert not drifting(drift(1.9))
    assert not drifting(drift(5, move=likely(0.98, tilt=0.98)))
    assert drifting(drift(5, move=likely(0.995, tilt=0.6)))
    assert not drifting(drift(5, move=likely(0.995, roll=0.9, tilt=0.4)))  # roll, which is small


def test_it_clears_where_a_move_is_unlikely_or_below_a_share_of_the_floor():
    assert drifting(drift(1.5), ("tilt",))
    assert not drifting(drift(1.3), ("tilt",))
    assert drifting(drift(5, move=likely(0.6, tilt=0.6)), ("tilt",))
    assert not drifting(drift(5, move=likely(0.4, tilt=0.4)), ("tilt",))


def test_a_window_that_tells_nothing_changes_nothing():
    nothing = drift(5, unidentifiable=("tilt", "roll", "height"))
    assert not drifting(nothing)
    assert drifting(nothing, ("tilt",))


def charted(statistic, parameter=3):
    return ChartResult(
        statistic=statistic,
        level=10.0,
        parameter=parameter,
        sign=1,
        walking_groups=20,
        track_idx=0,
        suspicious=statistic > 5,
    )


def test_the_chart_is_heeded_at_once_and_holds_until_both_are_calm():
    alarmed = judge(drift(), LIMITS, (), charted(10.5))
    assert (alarmed.drifted, alarmed.streak) == (("heading",), 1)
    verdict = judge(drift(5), LIMITS, (), charted(10.5))
    assert verdict.drifted == ("tilt",)  # the pose says better which
    assert not judge(drift(), LIMITS, (), charted(9.5)).drifting
    for statistic, holds in ((7.5, True), (6.5, False)):
        still = judge(drift(), LIMITS, alarmed.drifted, charted(statistic))
        assert still.drifting == holds
    assert judge(drift(1.5), LIMITS, alarmed.drifted, charted(6.5)).drifting
    unknown = drift(unidentifiable=THREE)
    assert judge(unknown, LIMITS, (), charted(10.5)).drifting


def test_a_heading_that_likelier_changed_is_a_drift_though_nobody_can_tell_how_far():
    untold = drift(heading_deg=12, move=likely(0.99, heading=0.6))
    verdict = judge(untold, LIMITS, ())
    assert (verdict.drifted, verdict.excess) == (("heading",), 1.0)
    assert not drifting(drift(heading_deg=12, move=likely(0.98, heading=0.98)))
    assert not drifting(drift(heading_deg=12, move=likely(0.99, roll=0.9, heading=0.4)))
    assert not drifting(drift(heading_deg=1.9, move=likely(0.99, heading=0.98)))
    # Of people who tell nothing else, too: 40 of a corridor that was panned by 60 deg.
    nothing = drift(8, 9, heading_deg=16, unidentifiable=THREE, move=likely(1.0, heading=0.92))
    assert judge(nothing, LIMITS, ()).drifted == ("heading",)


def test_an_alarm_of_the_chart_counts_where_the_pose_bears_it_out():
    for moved, alarmed in ((0.89, False), (0.91, True)):
        turned = likely(moved, heading=0.5)
        verdict = judge(drift(move=turned), LIMITS, (), charted(10.5))
        assert (verdict.alarmed, verdict.drifting) == (alarmed, alarmed)
    # A drift that was told before lasts while the chart alarms, whatever bears it out.
    assert judge(drift(move=likely(0.1)), LIMITS, ("heading",), charted(10.5)).drifting


def test_people_who_hurry_for_an_hour_bear_no_alarm_of_the_chart_out():
    """They look like a camera that is a little higher: as 400 of a mall's at half past four do."""
    hour = likely(0.98, height=0.98, tilt=0.4)
    assert not judge(drift(height_m=6.3, move=hour), LIMITS, (), charted(10.5)).drifting
    assert judge(drift(height_m=6.6, move=hour), LIMITS, (), charted(10.5)).drifting


def test_what_drifted_has_to_be_told_to_end():
    assert drifting(drift(unidentifiable=("tilt",)), ("tilt",))
    assert not drifting(drift(unidentifiable=("roll",)), ("tilt",))


def test_a_clock_fault_is_a_jump_in_scale_alone():
    scale = likely(1.0, height=1.0)
    found = clock_fault(drift(height_m=7.2, move=scale), 0.2, PRIOR, 25.0)
    assert found is not None
    assert found.code is TracksCode.SCALE_CHANGED
    assert found.values == {"factor": pytest.approx(1.2), "rate_hz": 25.0}
    lowered = clock_fault(drift(height_m=5.0, move=scale), 0.2, PRIOR, None)
    assert lowered is not None
    assert lowered.values == {"factor": pytest.approx(5 / 6), "rate_hz": 25.0}
    assert clock_fault(drift(height_m=7.2, move=scale), 0.3, PRIOR, 25.0) is None  # maybe turned
    for found in (
        drift(height_m=6.4, move=scale),  # 7 %: under the least
        drift(height_m=7.2, move=likely(0.6, height=0.4)),  # hardly of the height
        drift(height_m=7.2, move=scale, unidentifiable=("roll",)),
    ):
        assert clock_fault(found, 0.2, PRIOR, 25.0) is None


def test_a_wrong_clock_is_told_before_a_camera_that_stands():
    stands = drift(move=likely(0.02))
    told = judge(stands, LIMITS, (), scaled=True)
    assert (told.drifted, told.alarmed, told.drifting) == (("height",), True, True)
    assert not judge(stands, LIMITS, (), scaled=True, enough=False).drifting
    assert not judge(stands, LIMITS, told.drifted).drifting  # it was put right


@pytest.mark.parametrize("drifted", [(), ("tilt",)])
@pytest.mark.parametrize("moved", [0.0, 0.5, 0.89, 0.9, 0.98, 0.99, 1.0])
@pytest.mark.parametrize("statistic", [None, 1.0, 50.0])
@pytest.mark.parametrize("crept", [None, 1.0, 50.0])
def test_no_drift_is_told_of_what_may_not_be_told(drifted, moved, statistic, crept):
    """What is only told with a drift need not be computed before."""
    chart = slow_drift = None
    if statistic is not None:
        chart = ChartResult(
            statistic=statistic, level=10.0, parameter=0, sign=1, walking_groups=20, track_idx=0,
            suspicious=True,
        )  # fmt: skip
    if crept is not None:
        slow_drift = SlowDrift(
            statistic=crept, level=10.0, parameter=0, by=0.1, sd=0.01, since_day=1.0
        )
    now = drift(5.0, move=likely(moved, tilt=1.0))
    told = judge(now, LIMITS, drifted, chart, slow_drift).drifting
    assert may_be_alerted(moved, LIMITS, slow_drift, alerted=bool(drifted)) or not told
    assert may_be_alerted(0.5, LIMITS, None, alerted=False) is False


COVARIANCE = np.diag(np.radians([0.3, 0.4, 1.0, 6.0]) ** 2)


def test_served_error_of_a_moved_camera_includes_what_is_not_determined():
    found = drift(tilt_deg=3, roll_deg=-2, heading_deg=1, able=THREE)
    served = pose_after(found, PRIOR)
    error = served_error(found, PRIOR, COVARIANCE, served, moved=True)
    expected = COVARIANCE.copy()
    expected[3, 3] += math.radians(1) ** 2  # the posterior's mean, which is not served
    np.testing.assert_allclose(error, expected, atol=1e-15)


def test_served_error_without_a_move_counts_open_parameters_by_their_probability():
    move = likely(0.02, heading=0.01, tilt=0.02)
    found = drift(tilt_deg=0.5, able=THREE, move=move)
    error = served_error(found, PRIOR, COVARIANCE, PRIOR, moved=False)
    assert error[3, 3] == pytest.approx(0.01 * COVARIANCE[3, 3])
    assert error[0, 0] == pytest.approx(COVARIANCE[0, 0] + math.radians(0.5) ** 2)
    assert error[1, 1] == pytest.approx(COVARIANCE[1, 1])


def test_served_error_in_height_is_of_its_logarithm():
    found = drift(height_m=6.6, able=("tilt", "roll"))
    error = served_error(found, PRIOR, COVARIANCE, PRIOR, moved=True)
    assert error[2, 2] == pytest.approx(COVARIANCE[2, 2] + math.log(1.1) ** 2)
