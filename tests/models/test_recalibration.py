"""The calls that the service and the studies share: learn a site, estimate, read the chart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.assessment import AlarmRate, alarm_chart_result, judge
from models.assessment.estimate import since_alarm
from models.assessment.scale_faults import reason_of_causes
from models.errors import ShapeError, TooFewTrajectoriesError
from models.geometry.pose import array_of
from models.monitoring.chart_learning import learn_chart
from models.monitoring.group_scores import score_groups
from models.paths.folds import fold_maps
from models.pose import (
    DriftLimits,
    PoseFinding,
    assume_site,
    estimate_pose,
    learn_site,
    observe,
)
from models.pose.causes import CLOCK_LOGS, LENS_LOGS, CauseGains, likeliest_causes
from models.pose.change_point import find_change
from models.pose.estimating import pose_fit_of
from models.pose.pose_fit import by_speeds_alone
from models.reasons import Reason, TracksCode
from models.tracks.observations import of_tracks
from models.tracks.trajectory import by_end
from models.walking.estimate import joint_estimate
from studies.protocol.cases import ProtocolCase
from studies.protocol.flow_runs import fused
from studies.protocol.learned import Learned
from studies.protocol.served import served_pose
from studies.simulation.lanes import SiteConfig
from tests.models.sites import KNOCKED, LENS, PRIOR, near, seen, tracks_of

CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)
ONE_A_YEAR = AlarmRate(alarms_a_year=1.0, tracks_a_year=36_500.0)


@pytest.fixture(scope="module")
def tracks():
    """Reference tracks, then some of the still camera and of the knocked one."""
    known, still, after = tracks_of(3, (PRIOR, 150), (PRIOR, 60), (KNOCKED, 60), config=CONFIG)
    return [by_end(part) for part in (known, still, after)]


@pytest.fixture(scope="module")
def site(tracks):
    return learn_site(seen(tracks[0]), LENS, PRIOR)


@pytest.fixture(scope="module")
def window(tracks):
    return seen(by_end([*tracks[1], *tracks[2]]))


def swapped(tracks):
    """The same in another order than that of time."""
    return seen([*tracks[30:], *tracks[:30]])


def test_the_pose_is_from_the_change_on(site, window, tracks):
    found = estimate_pose(window, site)
    assert abs(found.change_idx - 60) <= 3
    assert found.first == found.change_idx
    assert (np.abs(near(found.pose) - near(KNOCKED)) < [0.7, 0.9, 0.3]).all(), found.pose
    # It is what is said of the tracks from there on alone.
    alone = estimate_pose(of_tracks(window, np.arange(found.first, window.tracks)), site)
    assert alone.change_idx is None
    np.testing.assert_array_equal(found.fused.values, alone.fused.values)
    assert found.fused.registered
    assert not found.failures


def test_a_still_camera_is_cut_nowhere_and_its_chart_is_calm(site, tracks):
    still = seen(tracks[1])
    found = estimate_pose(still, site)
    assert (found.change_idx, found.first) == (None, 0)
    assert abs(found.drift.by.tilt_rad) < np.radians(1)
    assert not alarm_chart_result(still, site, ONE_A_YEAR).moved


def test_the_chart_alarms_at_the_rate_that_is_allowed(site, window):
    result = alarm_chart_result(window, site, ONE_A_YEAR)
    assert result.moved
    assert result.track_idx == pytest.approx(60, abs=12)
    often = alarm_chart_result(window, site, replace(ONE_A_YEAR, alarms_a_year=100.0))
    assert often.level < result.level


def test_an_alarm_of_the_chart_is_judged_by_the_pose_of_the_tracks_that_it_is_of(
    site, window, tracks
):
    # Twenty people after the knock: too few beside sixty for the window's own pose.
    early = of_tracks(window, np.arange(80))
    chart = alarm_chart_result(early, site, ONE_A_YEAR)
    whole = pose_fit_of(early, site)
    found = PoseFinding(prior=PRIOR, joint=whole.joint, fused=whole.fused, moved_prior=0.01)
    since = since_alarm(found, early, site, chart)
    assert since.first == chart.track_idx >= 50
    assert since.posterior.moved > 0.9 > found.posterior.moved
    assert abs(since.drift.by.tilt_rad) > 2 * abs(found.drift.by.tilt_rad)


def test_an_alarm_that_the_pose_does_not_bear_out_is_none(site, tracks):
    still = seen(tracks[1])
    found = estimate_pose(still, site)
    calm = alarm_chart_result(still, site, ONE_A_YEAR)
    assert since_alarm(found, still, site, calm) is found
    loud = replace(calm, statistic=calm.level + 1, track_idx=20)
    assert since_alarm(found, still, site, loud) is found
    assert not judge(found.drift, DriftLimits(), (), loud).drifting
    # A tenth of what is beyond the level counts: 60 of it are odds of 400 to 1.
    deafening = replace(loud, statistic=calm.level + 60)
    since = since_alarm(found, still, site, deafening)
    assert since.first == 20
    assert since.moved_prior == pytest.approx(1 / (1 + 4 * math.exp(-6)))


def test_people_on_no_path_bear_no_alarm_out(site, window):
    gone = Reason(code=TracksCode.PATHS_CHANGED)
    whole = pose_fit_of(window, site)
    fused = replace(whole.fused, reason=gone)
    found = PoseFinding(prior=PRIOR, joint=whole.joint, fused=fused, moved_prior=1e-6)
    chart = alarm_chart_result(window, site, ONE_A_YEAR)
    assert chart.moved
    assert since_alarm(found, window, site, chart) is found


def test_the_chart_asks_those_after_the_change_who_count_or_else_all_who_do(site, window):
    counted = np.ones(window.tracks, dtype=bool)
    counted[:40] = False
    late = alarm_chart_result(window, site, ONE_A_YEAR, counted=counted, first=70)
    alone = alarm_chart_result(of_tracks(window, np.arange(70, 120)), site, ONE_A_YEAR)
    assert late == replace(alone, track_idx=alone.track_idx + 70)
    # Ten tracks after the change are too few: all that count are asked.
    few = alarm_chart_result(window, site, ONE_A_YEAR, counted=counted, first=110)
    assert few == alarm_chart_result(window, site, ONE_A_YEAR, counted=counted)
    assert few.track_idx >= 40
    nobody = np.zeros(window.tracks, dtype=bool)
    assert alarm_chart_result(window, site, ONE_A_YEAR, counted=nobody) is None


def test_a_map_that_grows_keeps_how_people_walk_and_weighs_its_tracks(site, tracks):
    every = seen([*tracks[0], *tracks[1]])
    evenly = learn_site(every, LENS, PRIOR, speed_reference=site.speed_reference)
    weights = np.linspace(0.05, 1, every.tracks)
    faded = learn_site(
        every, LENS, PRIOR, speed_reference=site.speed_reference, weights=weights, chart=False
    )
    assert evenly.speed_reference is faded.speed_reference is site.speed_reference
    assert evenly.chart.walking_groups > site.chart.walking_groups
    assert site.paths.people < evenly.paths.people
    assert faded.paths.people < evenly.paths.people


def test_speeds_of_the_first_tracks_and_a_map_of_all(site, tracks):
    every = seen([*tracks[0], *tracks[1]])
    found = learn_site(every, LENS, PRIOR, speed_tracks=150, chart=False)
    np.testing.assert_array_equal(found.speed_reference.offset, site.speed_reference.offset)
    assert found.chart is None
    assert found.paths.people > site.paths.people


def test_few_people_make_no_map_and_fewer_no_site(tracks):
    few = learn_site(seen(tracks[0][:8]), LENS, PRIOR)
    assert few.learned
    assert (few.paths, few.chart) == (None, None)
    found = estimate_pose(seen(tracks[2]), few)
    assert not found.fused.registered
    assert alarm_chart_result(seen(tracks[2]), few, ONE_A_YEAR) is None
    with pytest.raises(TooFewTrajectoriesError, match="at least 5"):
        learn_site(seen(tracks[0][:3]), LENS, PRIOR)


def test_a_site_of_which_nothing_is_known_is_searched_for_no_change(window):
    site = assume_site(window, LENS, PRIOR)
    assert not site.learned
    found = estimate_pose(window, site)
    joint = joint_estimate(window, PRIOR, site.speed_reference)
    np.testing.assert_array_equal(found.joint.values, joint.values)
    np.testing.assert_array_equal(found.fused.values, by_speeds_alone(joint, PRIOR).values)
    assert found.change_idx is None


@pytest.mark.parametrize("fails_at", ["search", "pose"])
def test_a_map_that_fails_is_told_and_the_pose_is_by_speeds(site, tracks, fails_at):
    asked = seen(tracks[1])
    if fails_at == "search":
        paths = replace(site.paths, still=replace(site.paths.still, covariance=np.eye(3)))
    else:
        paths = replace(site.paths, bias=np.zeros(3))
    spoilt = replace(site, paths=paths)
    found = estimate_pose(asked, spoilt)
    (lack,) = found.failures
    assert lack.part == "flow_map"
    assert isinstance(lack.error, ValueError)
    assert not found.fused.registered
    blind = estimate_pose(asked, replace(site, paths=None))
    assert found.change_idx == blind.change_idx
    np.testing.assert_array_equal(found.fused.values, blind.fused.values)
    with pytest.raises(ValueError, match="dimension|shape|broadcast|signature|match"):
        served_pose(asked, spoilt)  # a study does not do without


def test_the_study_s_fused_pose_is_the_served_one_with_its_change(site, window, tracks):
    case = ProtocolCase(
        scene_id="simulated",
        seed=0,
        intrinsics=LENS,
        prior_pose=PRIOR,
        true_pose=KNOCKED,
        reference=tuple(tracks[0]),
        seen=tuple(by_end([*tracks[1], *tracks[2]])),
    )
    learned = Learned(
        case=case, seen=window, site=site, feet=window, feet_speed_reference=site.speed_reference
    )
    answer, found = fused(learned), estimate_pose(window, site)
    np.testing.assert_array_equal(answer.values, found.fused.values[:3])
    assert answer.tracks == found.joint.walkers < window.walkers - 50


def refusals(site, tracks):
    """All that goes by the order of time, each given tracks out of order."""
    mixed = swapped(tracks)
    folds = fold_maps(mixed, LENS, array_of(PRIOR), 0)
    return {
        "learn_site": lambda: learn_site(mixed, LENS, PRIOR),
        "estimate_pose": lambda: estimate_pose(mixed, site),
        "alarm_chart_result": lambda: alarm_chart_result(mixed, site, ONE_A_YEAR),
        "score_groups": lambda: score_groups(mixed, site.usual(site.paths, site.chart)),
        "find_change": lambda: find_change(mixed, PRIOR, site.speed_reference),
        "learn_chart": lambda: learn_chart(mixed, PRIOR, site.speed_reference, folds, 0),
    }


@pytest.mark.parametrize(
    "call",
    [
        "learn_site",
        "estimate_pose",
        "alarm_chart_result",
        "score_groups",
        "find_change",
        "learn_chart",
    ],
)
def test_tracks_out_of_order_are_refused(site, tracks, call):
    gone_s = float(tracks[1][-1].time_s[-1] - tracks[1][0].time_s[-1])
    with pytest.raises(ShapeError, match="order of their ends, got one at 30 that ended") as told:
        refusals(site, tracks[1])[call]()
    assert f"{gone_s:g} s before the one at 29" in str(told.value)


def test_tracks_that_ended_together_are_in_order(site, tracks):
    """People who leave a train: ten at a time are seen no more. A cut never goes through them."""
    ends = [tracks[2][number - number % 10].time_s[-1] for number in range(60)]
    together = [
        replace(track, time_s=track.time_s - track.time_s[-1] + end_s)
        for track, end_s in zip(tracks[2], ends, strict=True)
    ]
    crowd = observe([*tracks[1], *together], LENS, PRIOR)
    found = estimate_pose(crowd, site)
    assert found.change_idx is not None
    assert found.first == 60 <= found.change_idx


def test_times_that_are_too_short_are_a_wrong_clock_and_no_move(tracks, site):
    fast = estimate_pose(seen([replace(t, time_s=0.8 * t.time_s) for t in tracks[1]]), site)
    clock, lens = fast.causes
    assert clock.probability > 0.7 > 0.1 > lens.probability
    assert clock.factor == pytest.approx(0.8, abs=0.04)
    assert fast.posterior.moved < 0.1
    named = reason_of_causes(fast.causes, fast.posterior.moved, 0.7, 30.0)
    assert named.code is TracksCode.SCALE_CHANGED
    assert reason_of_causes(fast.causes, fast.posterior.moved, clock.probability + 1e-6, 1) is None


@pytest.mark.parametrize("zoom", [0.8, 1.25])
def test_a_lens_that_was_zoomed_is_no_move(tracks, site, zoom):
    middle = np.array([LENS.cx, LENS.cy])
    every = []
    for track in tracks[1]:
        uv = middle + zoom * (track.uv - middle)
        inside = LENS.contains(uv)
        if inside.sum() > 8:
            every.append(replace(track, uv=uv[inside], time_s=track.time_s[inside]))
    found = estimate_pose(seen(by_end(every)), site)
    clock, lens = found.causes
    assert lens.probability > 0.9 > 0.1 > clock.probability
    assert lens.factor == pytest.approx(zoom, rel=0.05)
    named = reason_of_causes(found.causes, found.posterior.moved, 0.9, None)
    assert named.code is TracksCode.LENS_CHANGED


def test_a_fisheye_is_asked_for_its_clock_alone(tracks, site):
    bent = replace(site, intrinsics=replace(LENS, distortion=(), projection="fisheye"))
    slow = seen([replace(t, time_s=1.25 * t.time_s) for t in tracks[1]])
    gains = estimate_pose(slow, bent).gains
    posterior = estimate_pose(slow, site).posterior
    clock, lens = likeliest_causes(gains, posterior, 60, 0.2)
    assert lens.probability < 1e-9
    assert clock.factor == pytest.approx(1.25, abs=0.06)


def test_gains_of_thousands_are_certain_and_overflow_nothing(tracks, site):
    found = estimate_pose(seen(tracks[2]), site)
    for worth in (1e-3, 1e5):
        gains = CauseGains(
            clock=-worth * np.abs(CLOCK_LOGS - 0.2),
            lens_speeds=-worth * np.abs(LENS_LOGS),
            lens_places=-worth * np.abs(LENS_LOGS),
            pose=worth,
        )
        assert all(
            0 <= each.probability < 1 for each in likeliest_causes(gains, found.posterior, 400, 0.2)
        )


def test_neither_clock_nor_lens_is_wrong_before_a_camera_that_stands_or_moved(tracks, site):
    for other in (tracks[1], tracks[2]):
        found = estimate_pose(seen(other), site)
        assert found.causes is None or max(each.probability for each in found.causes) < 0.05
        assert reason_of_causes(found.causes, found.posterior.moved, 0.9, 30.0) is None
