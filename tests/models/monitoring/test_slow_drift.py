"""Slow drift: logs with simulated noise, tested against the first map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.assessment import begin_slow_drift_log, log_slow_drift, without_slow_drift
from models.errors import CheckpointError
from models.monitoring.group_scores import score_groups
from models.monitoring.slow_drift import (
    DAY_S,
    NUMBERS,
    SlowDriftLog,
    add_day,
    begin_log,
    noise_of,
    posterior_mean_turns,
    slow_drift_log_from_bytes,
    slow_drift_log_to_bytes,
    slow_drift_result,
    weeks_of,
)
from models.pose import learn_site, observe
from models.serialization import flattened
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.trajectory import by_end
from tests.models.sites import LENS, PRIOR, tracks_of

PERSON_SD = np.array([math.radians(5), math.radians(4), 0.2, math.radians(6), 0.2])
MONTH_DAYS = 365.25 / 12
A_YEAR = 0.1


def blank(days, groups=18.0, reference=200.0):
    return SlowDriftLog(
        day_idx=np.arange(20_000, 20_000 + days),
        groups=np.full(days, groups),
        pulls=np.zeros((days, NUMBERS)),
        information=np.diag(PERSON_SD**-2),
        reference_groups=reference,
        since_day=20_000.0,
    )


def with_moves(log, moves):
    """The log of days whose people say each of some moves (D, 5) alone."""
    return replace(log, pulls=log.groups[:, None] * moves @ log.information)


def drawn(log, rng):
    """A log of a camera that stands, by the noise that weeks are taken to have."""
    weeks = weeks_of(log, None)
    lower = np.linalg.cholesky(noise_of(log, weeks))
    moves = (lower @ rng.normal(size=lower.shape[0])).reshape(-1, NUMBERS)
    of_day = (log.day_idx[-1] - log.day_idx) // 7
    return with_moves(log, moves[of_day])


def ramp(log, number, deg_a_month):
    turned = np.zeros((log.day_idx.size, NUMBERS))
    days = log.day_idx + 0.5 - log.since_day
    turned[:, number] = math.radians(deg_a_month) * days / MONTH_DAYS
    return turned


@pytest.mark.parametrize("number", [0, 1, 3])
@pytest.mark.parametrize("deg_a_month", [0.5, -1.0])
def test_a_ramp_is_told_with_its_number_way_and_size(number, deg_a_month):
    log = blank(int(2.5 / abs(deg_a_month) * MONTH_DAYS))
    drift = slow_drift_result(with_moves(log, ramp(log, number, deg_a_month)), A_YEAR)
    assert drift.moved
    assert drift.parameter == number
    assert math.degrees(drift.by) == pytest.approx(math.copysign(2.5, deg_a_month), rel=0.1)
    assert drift.since_day == pytest.approx(log.since_day, abs=40)


def test_a_late_ramp_is_said_to_have_begun_late():
    log = blank(200)
    late = replace(log, since_day=20_140.0)
    turned = np.where(log.day_idx[:, None] >= 20_140, ramp(late, 3, 1.0), 0.0)
    drift = slow_drift_result(with_moves(log, turned), A_YEAR)
    assert drift.moved
    assert drift.since_day == pytest.approx(20_140, abs=15)


def test_stationary_cameras_have_no_more_false_alarms_than_allowed():
    rng = np.random.default_rng(5)
    logs = [drawn(blank(180), rng) for _ in range(200)]
    told = sum(slow_drift_result(log, A_YEAR).moved for log in logs)
    assert told <= 8  # one look at each, half a year in: 4 % at the most, were all looks one
    often = sum(slow_drift_result(log, 100.0).moved for log in logs)
    assert often > 60


def test_height_and_speed_are_not_reported_as_slow_drift():
    log = blank(150)
    for number in (2, 4):
        turned = np.zeros((150, NUMBERS))
        turned[:, number] = np.linspace(0, 0.1, 150)
        assert not slow_drift_result(with_moves(log, turned), A_YEAR).moved


def test_few_people_say_nothing_and_only_whole_days_since_a_time_count():
    log = blank(60)
    assert slow_drift_result(blank(3), A_YEAR) is None
    turned = ramp(log, 0, 3.0)
    assert slow_drift_result(with_moves(log, turned), A_YEAR).moved
    from_s = (20_000 + 57) * DAY_S
    assert slow_drift_result(with_moves(log, turned), A_YEAR, from_s) is None
    assert weeks_of(log, from_s - 30 * DAY_S + 1).groups.sum() == 18 * 32


def test_rest_of_the_reference_day_is_no_slow_drift():
    """It ended at 18:00 of a day whose middle is noon: the ramp's turn was 0 / 0, and kept so."""
    afternoon = replace(blank(1, groups=400.0), since_day=20_000.75)
    assert slow_drift_result(afternoon, A_YEAR) is None
    assert np.isfinite(posterior_mean_turns(afternoon, np.array([20_000.5]))).all()
    result = slow_drift_result(replace(blank(2, groups=400.0), since_day=20_000.75), A_YEAR)
    assert result.statistic == 0
    assert math.isfinite(result.sd)


def test_a_turn_is_believed_once_it_is_clear_and_a_still_camera_is_left_alone():
    log = blank(120)
    days = np.array([20_010.0, 20_060.0, 20_119.0])
    crept = posterior_mean_turns(with_moves(log, ramp(log, 3, 1.0)), days)
    true = np.radians((days - 20_000) / MONTH_DAYS)
    assert_allclose(crept[:, 3], true, atol=math.radians(0.5))
    assert np.abs(crept[:, :3]).max() < math.radians(0.05)
    rng = np.random.default_rng(2)
    still = np.array([posterior_mean_turns(drawn(log, rng), days) for _ in range(50)])
    assert np.median(np.abs(still)) < math.radians(0.01)
    assert not posterior_mean_turns(blank(2), days).any()


@pytest.fixture(scope="module")
def first():
    (known, later) = tracks_of(3, (PRIOR, 60), (PRIOR, 80))
    site = learn_site(observe(by_end(known), LENS, PRIOR), LENS, PRIOR)
    later = by_end(later)
    spread = [
        replace(track, time_s=track.time_s + DAY_S * (number // 10))
        for number, track in enumerate(later)
    ]
    return site, by_end(known), by_end(spread)


def test_a_log_is_the_same_however_its_days_came(first):
    site, known, later = first
    whole = log_slow_drift(begin_slow_drift_log(site, 0.0), observe(later, LENS, PRIOR), site)
    parts = begin_slow_drift_log(site, 0.0)
    for day in whole.day_idx:
        tracks = [track for track in later if track.time_s[-1] // DAY_S == day]
        for _ in range(2):  # by a job that runs twice, too
            parts = log_slow_drift(parts, observe(tracks, LENS, PRIOR), site)
    for name, value in flattened(whole).items():
        assert_allclose(flattened(parts)[name], value, rtol=1e-6, atol=1e-6)


def test_a_turned_camera_pulls_its_log_that_way(first):
    site, _, later = first
    for name, number in (("tilt_rad", 0), ("heading_rad", 3)):
        knocked = PoseOffset(
            **{"tilt_rad": 0.0, "roll_rad": 0.0, "log_height": 0.0, name: math.radians(2)}
        ).apply(PRIOR)
        seen = [offset_trajectory(track, LENS, PRIOR, knocked) for track in later]
        seen = [track for track in seen if track is not None and track.long_enough]
        log = log_slow_drift(
            begin_slow_drift_log(site, 0.0), observe(by_end(seen), LENS, PRIOR), site
        )
        pull = log.pulls.sum(axis=0) * np.sqrt(np.diag(np.linalg.inv(log.information)))
        assert pull[number] > 0
        without = log_slow_drift(begin_slow_drift_log(site, 0.0), observe(later, LENS, PRIOR), site)
        assert pull[number] > 3 * abs(without.pulls.sum(axis=0)[number]) * math.sqrt(
            np.linalg.inv(log.information)[number, number]
        )


def test_tracks_without_their_turn_are_seen_as_from_the_prior_pose(first):
    site, known, later = first
    log = blank(120)
    log = with_moves(log, ramp(log, 3, 1.0))
    turn = posterior_mean_turns(log, np.array([20_100.0]))[0]
    stood = replace(PRIOR, heading_rad=PRIOR.heading_rad + turn[3])
    track = replace(known[0], time_s=known[0].time_s - known[0].time_s[-1] + 20_100.0 * DAY_S)
    seen = offset_trajectory(track, LENS, PRIOR, stood)
    (back,) = without_slow_drift([seen], LENS, PRIOR, log)
    assert np.abs(seen.uv[0] - track.uv[0]).max() > 5
    same = np.isin(track.time_s, back.time_s)
    # Tilt and roll are believed to have moved by hundredths of a degree.
    assert_allclose(back.uv, track.uv[same], atol=2.0)
    still = with_moves(blank(120), np.zeros((120, NUMBERS)))
    assert without_slow_drift([track], LENS, PRIOR, still) == [track]


def test_bytes_keep_a_log_and_its_names():
    log = with_moves(blank(40), ramp(blank(40), 1, 0.3))
    back = slow_drift_log_from_bytes(slow_drift_log_to_bytes(log))
    # The names that stores have: another one needs a version of its own.
    assert set(flattened(log)) == {
        "day_idx", "groups", "pulls", "information", "reference_groups", "since_day"
    }  # fmt: skip
    for name, value in flattened(log).items():
        assert_array_equal(flattened(back)[name], value)
    assert slow_drift_log_to_bytes(back) == slow_drift_log_to_bytes(log)
    with pytest.raises(CheckpointError, match="creep: not readable"):
        slow_drift_log_from_bytes(slow_drift_log_to_bytes(log)[:-20])


def test_days_of_a_chart_begin_with_none(first):
    site, _, _ = first
    log = begin_log(site.chart, 3 * DAY_S)
    assert (log.day_idx.size, log.since_day) == (0, 3.0)
    assert log.reference_groups == site.chart.walking_groups
    assert np.linalg.eigvalsh(log.information).min() > 0
    empty = score_groups(observe([], LENS, PRIOR), site.usual(site.paths, site.chart))
    assert not add_day(log, site.chart, 5, empty).pulls.any()
