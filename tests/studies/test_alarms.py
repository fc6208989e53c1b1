"""How alarms are measured: renewals, delays and rates by hand; a year of habits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.durations import DAY_S
from models.geometry.ground import ground_from_pixel
from models.monitoring.chart import OFFSET_GRID, DriftChart, GridOffset, ratios_of
from models.monitoring.drift import DriftLimits
from models.monitoring.group_scores import SCORES
from models.tracks.scenes import load_scene
from studies.alarms.camera_years import live_year
from studies.alarms.results import (
    AlarmResults,
    Delay,
    by_knock,
    offsets_of,
    rate_interval,
    share_within,
)
from studies.alarms.scene_alarms import judge_scene
from studies.alarms.watch import Watch, first_alarm
from studies.simulation.habits import HabitConfig, walk_days
from studies.simulation.lanes import SiteConfig, draw_lanes
from tests.conftest import SCENES
from tests.models.sites import LENS, PRIOR

QUIET = SiteConfig(noise_px=0.0, standing_share=0.0, between_sd=0.0, within_sd=0.0)
EVEN = HabitConfig(
    evenness=1e9, rain_share=0.0, crowd_share=0.0, day_sd=0.0, season=0.0, weekend_faster=0.0
)


@pytest.fixture
def watch():
    """One knock, of the heading, moves the last of independent scores by 2; the level is 10."""
    responses = np.zeros((SCORES, len(OFFSET_GRID)))
    responses[-1, OFFSET_GRID.index(GridOffset(parameter=3, size=math.radians(6)))] = 2.0
    chart = DriftChart(
        speed_reference=None,
        middle=np.zeros(SCORES),
        width=np.ones(SCORES),
        mean=np.zeros(SCORES),
        covariance=np.eye(SCORES),
        responses=responses,
        walking_groups=1e9,
        typical=0.0,
        tail=1.0,
    )
    return Watch(chart=chart, usual=None, ratios=ratios_of(chart), level=10.0)


def test_alarms_are_renewed_after_each(watch):
    apart = np.zeros((60, SCORES))
    apart[:, -1] = 2.0  # sixteen walking groups come to 16 * 2 = 32, and fewer are not asked
    assert watch.alarms(apart) == [16, 32, 48]
    assert first_alarm(watch, apart, 2.5) == 40.0
    assert watch.alarms(np.zeros((300, SCORES))) == []
    assert first_alarm(watch, np.zeros((300, SCORES)), 2.5) == math.inf


def results(alarms, years=1.0, delays=()):
    return AlarmResults(
        name="x",
        seed=0,
        walking_groups=60,
        years=years,
        false_alarms=alarms,
        highest=0.5,
        pose_excess=0.0,
        delays=delays,
    )


def test_a_rate_has_an_interval_of_cases_that_differ():
    low, high = rate_interval([results(1)] * 50)
    assert (low, high) == (1.0, 1.0)
    low, high = rate_interval([results(50)] + [results(0)] * 49)
    assert low == 0.0
    assert 2.5 < high <= 4.0  # the one odd camera is drawn three times or so
    assert rate_interval([results(0, years=2.0)] * 10) == (0.0, pytest.approx(3.689 / 20))


def test_delays_are_by_knock_and_never_is_not_within():
    delays = [Delay(angle_deg=5, pan=False, tracks=t) for t in (10, 61, math.inf)]
    found = by_knock([results(0, delays=tuple(delays))])
    assert share_within(found[(5, False)], 60) == pytest.approx(1 / 3)


def test_knocks_have_the_angle_that_is_asked():
    found = offsets_of([5.0, 2.0], np.random.default_rng(0))
    assert [(asked.angle_deg, asked.pan) for asked, _ in found] == [
        (5.0, False), (5.0, True), (2.0, False), (2.0, True)
    ]  # fmt: skip
    for asked, knock in found:
        turned = knock.heading_rad if asked.pan else math.hypot(knock.tilt_rad, knock.roll_rad)
        assert math.degrees(abs(turned)) == pytest.approx(asked.angle_deg)


def days_of(habits, days=14, tracks_a_day=40.0, seed=0):
    lanes = draw_lanes(LENS, PRIOR, QUIET, np.random.default_rng(3))
    life = walk_days(
        LENS,
        PRIOR,
        lanes,
        QUIET,
        habits,
        tracks_a_day=tracks_a_day,
        days=range(days),
        rng=np.random.default_rng(seed),
    )
    return list(life)


def speeds(tracks):
    found = []
    for track in tracks:
        ground, _ = ground_from_pixel(LENS, PRIOR.rotation, PRIOR.centre_m, track.uv)
        step = np.linalg.norm(np.diff(ground, axis=0), axis=1) / np.diff(track.time_s)
        found.append(np.median(step))
    return np.array(found)


def test_days_follow_one_another_and_weekends_have_fewer_people():
    days = days_of(EVEN, days=28, tracks_a_day=60.0)
    for day, tracks in enumerate(days):
        ends = [track.time_s[-1] for track in tracks]
        assert ends == sorted(ends)
        assert min(track.time_s[0] for track in tracks) >= day * DAY_S
        assert max(ends) < (day + 1) * DAY_S + 7200
    working = [len(tracks) for day, tracks in enumerate(days) if day % 7 < 5]
    weekend = [len(tracks) for day, tracks in enumerate(days) if day % 7 >= 5]
    assert np.mean(working) == pytest.approx(60, rel=0.1)
    assert np.mean(weekend) == pytest.approx(36, rel=0.2)


def test_rain_makes_people_faster_and_fewer():
    dry, wet = days_of(EVEN), days_of(replace(EVEN, rain_share=1.0))
    faster = np.log(speeds(sum(wet, [])).mean() / speeds(sum(dry, [])).mean())
    assert faster == pytest.approx(0.04, abs=0.005)
    assert sum(map(len, wet)) == pytest.approx(0.6 * sum(map(len, dry)), rel=0.15)


def test_the_same_seed_lives_the_same_days():
    one, again, other = (days_of(HabitConfig(), days=3, seed=seed) for seed in (1, 1, 2))
    assert [len(tracks) for tracks in one] == [len(tracks) for tracks in again]
    np.testing.assert_array_equal(one[1][0].uv, again[1][0].uv)
    assert [len(t) for t in one] != [len(t) for t in other]


@pytest.mark.slow
def test_a_simulated_camera_is_quiet_for_six_weeks_and_notices_five_degrees():
    found = live_year(
        1,
        0,
        alarms_a_year=1.0,
        tracks_a_day=60.0,
        reference_tracks=200,
        days=42,
        angles_deg=(5.0,),
    )
    assert found.false_alarms == 0
    assert found.years == pytest.approx(42 / 365.25)
    assert len(found.delays) == 2
    assert all(delay.tracks <= 60 for delay in found.delays)


@pytest.mark.slow
def test_a_recorded_camera_is_judged_still_and_knocked():
    folder = SCENES / "wildtrack_c6"
    if not folder.is_dir():
        pytest.skip(f"no recorded scenes in {SCENES}")
    limits = DriftLimits(
        certainty=0.99, floor_rad=math.radians(1), floor_m=0.3, people=12, clear_ratio=0.7
    )
    found = judge_scene(
        load_scene(folder),
        2,
        alarms_a_year=1.0,
        tracks_a_day=100.0,
        years=0.1,
        angles_deg=(5.0,),
        limits=limits,
    )
    assert found.false_alarms == 0
    assert 0 < found.highest < 1
    assert 0 < found.pose_excess < 1
    assert found.walking_groups == pytest.approx(60, abs=15)
    assert [len(own) for own in by_knock([found]).values()] == [10, 10]
    assert share_within(by_knock([found])[(5.0, False)], 130) == 1.0
