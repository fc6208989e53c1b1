"""How many people come when, and how improbable it is that none do."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.monitoring.arrivals import (
    ArrivalProcess,
    SilenceRule,
    chance_of_silence,
    delay_of,
    expected_tracks,
    judge_silence,
    learn_arrivals,
)
from studies.alarms.arrivals_study import describe, study_rhythm

RULE = SilenceRule(false_per_year=1.0, least_s=600.0, limit_s=86_400.0)
DAY_CELLS, WEEKEND_CELLS = np.arange(24), np.arange(24, 48)


def rhythm(rates=None, burst=1.0, shape=10.0):
    rates = tuple(rates if rates is not None else [2.0] * 48)
    return ArrivalProcess(rates=rates, burst=burst, shape=shape, usual_gap_s=60.0, days=14)


def days(weekday, weekend, weeks):
    """Counts and cells of weeks that begin on a Monday."""
    counts = np.concatenate([np.tile(weekday, 5), np.tile(weekend, 2)] * weeks)
    cells = np.concatenate([np.tile(DAY_CELLS, 5), np.tile(WEEKEND_CELLS, 2)] * weeks)
    return counts.astype(float), cells


def learned(counts, cells, known=None, times_s=()):
    known = np.ones(len(counts), dtype=bool) if known is None else known
    return learn_arrivals(counts, cells, known, 0, np.array(times_s, dtype=float))


def test_groups_of_a_year():
    assert rhythm(burst=4.0).arrivals_per_year == pytest.approx(2 * 8766 / 4)
    weekdays_only = rhythm([7.0] * 24 + [0.0] * 24)
    assert weekdays_only.arrivals_per_year == pytest.approx(5 * 8766)


def test_tracks_expected_between_two_times():
    rates = np.zeros(48)
    rates[8], rates[9] = 6.0, 12.0
    half_past, quarter_past = 8.5 * 3600, 9.25 * 3600
    found = expected_tracks(rhythm(rates), np.arange(24), 0, half_past, quarter_past)
    assert found == pytest.approx(0.5 * 6 + 0.25 * 12)
    assert expected_tracks(rhythm(rates), np.arange(8, 10), 8, half_past, quarter_past) == found
    assert expected_tracks(rhythm(rates), np.arange(24), 0, quarter_past, half_past) == 0


def test_the_chance_of_a_silence_is_gamma_poisson():
    # At once, nothing seen before: a usual day, Gamma(10, 10), or a quiet one, Gamma(20, 80).
    expected = 0.95 * (10 / 15) ** 10 + 0.05 * (80 / 85) ** 20
    assert chance_of_silence(rhythm(), 5.0, 0.0, 0.0, 0.0) == pytest.approx(expected)
    assert expected == pytest.approx(0.031347, rel=1e-4)
    # In walking groups of four, twenty tracks are five walking groups.
    assert chance_of_silence(rhythm(burst=4), 20.0, 0.0, 0.0, 0.0) == pytest.approx(expected)
    # After long, the day is another, and may have turned quiet.
    other = 0.9 * (10 / 15) ** 10 + 0.1 * (80 / 85) ** 20
    assert chance_of_silence(rhythm(), 5.0, 1e9, 0.0, 0.0) == pytest.approx(other)


def test_what_was_seen_before_tells_the_level_of_the_day():
    def chance(seen):
        return chance_of_silence(rhythm(), 15.0, 0.0, seen, 30.0)

    # 30 of 30: all but surely no quiet day, whose odds against a usual one would be e^-15 or so.
    assert chance(30) == pytest.approx((40 / 55) ** 40, rel=0.01)
    assert chance(5) > 1000 * chance(30)
    assert chance(60) < chance(30) / 100


@pytest.mark.parametrize(
    ("missed", "silent_s", "verdict"),
    [
        (0.0, 8 * 3600.0, "usual"),  # a night
        (500.0, 599.0, "usual"),  # shorter than the least
        (8.0, 3600.0, "usual"),
        (200.0, 3600.0, "improbable"),
        (40.0, 90_000.0, "too_long"),  # chance 4e-4, beyond the fixed limit
        (2.9, 900_000.0, "usual"),  # of a camera that hardly sees anybody
    ],
)
def test_a_silence_is_judged_by_its_chance_and_by_the_fixed_limit(missed, silent_s, verdict):
    found = judge_silence(rhythm(), RULE, missed=missed, silent_s=silent_s, seen=6.0, expected=6.0)
    assert found == verdict


def test_the_rate_that_was_set_moves_the_threshold():
    numbers = {"missed": 40.0, "silent_s": 3600.0, "seen": 6.0, "expected": 6.0}
    chance = chance_of_silence(rhythm(), 40.0, 3600.0, 6.0, 6.0)
    just = chance * rhythm().arrivals_per_year
    for share, verdict in ((0.99, "usual"), (1.01, "improbable")):
        rule = SilenceRule(false_per_year=share * just, least_s=600.0, limit_s=86_400.0)
        assert judge_silence(rhythm(), rule, **numbers) == verdict


def test_weekends_are_apart_once_there_are_two_of_them():
    counts, cells = days(np.full(24, 10.0), np.full(24, 2.0), weeks=1)
    pooled = (5 * 10 + 2 * 2) / 7
    assert_allclose(learned(counts, cells).rates, [pooled] * 48)
    counts, cells = days(np.full(24, 10.0), np.full(24, 2.0), weeks=2)
    assert_allclose(learned(counts, cells).rates, [10.0] * 24 + [2.0] * 24)
    assert learned(counts, cells).days == 14


def test_an_hour_borrows_a_day_from_those_beside_it():
    weekday = np.zeros(24)
    weekday[12] = 9.0
    counts, cells = days(weekday, weekday, weeks=2)
    rates = learned(counts, cells).rates
    # Ten weekdays of 9, and one of the mean of 0, 9 and 0.
    assert_allclose(rates[11:14], [3 / 11, 93 / 11, 3 / 11])
    assert rates[10] == 0


def test_an_outage_teaches_nothing():
    counts, cells = days(np.full(24, 10.0), np.full(24, 10.0), weeks=2)
    known = np.ones(len(counts), dtype=bool)
    known[24:72], counts[24:72] = False, 0.0
    found = learned(counts, cells, known)
    assert_allclose(found.rates, [10.0] * 48)
    assert found.days == 12
    assert found.shape == learned(counts[72:], cells[72:]).shape or found.shape > 5


def test_gaps_that_are_longer_than_chance_make_a_burst():
    counts, cells = days(np.full(24, 6.0), np.full(24, 6.0), weeks=2)
    regular = 600.0 * np.arange(6 * 24 * 14)
    assert learned(counts, cells, times_s=regular).burst == 1.0
    # Four at once every 40 minutes: of the gaps, measured in tracks expected, 25 % are 4.
    fours = np.repeat(2400.0 * np.arange(6 * 24 * 14 // 4), 4)
    assert learned(counts, cells, times_s=fours).burst == pytest.approx(4 / math.log(10))
    assert learned(counts, cells, times_s=regular[:50]).burst == 3.0  # too few to tell


def test_people_who_come_alone_have_no_burst_whatever_the_hour():
    rng = np.random.default_rng(5)
    weekday = np.where((np.arange(24) > 6) & (np.arange(24) < 20), 40.0, 0.5)
    means, cells = days(weekday, weekday, weeks=4)
    counts = rng.poisson(means)
    times_s = np.sort(3600 * (np.repeat(np.arange(len(counts)), counts) + rng.random(counts.sum())))
    found = learned(counts.astype(float), cells, times_s=times_s)
    assert 1.0 <= found.burst < 1.05
    assert found.shape > 20  # days differ by chance alone


def test_days_that_differ_lower_the_shape():
    full, _ = days(np.full(24, 100.0), np.full(24, 100.0), weeks=4)
    level = np.tile([0.5, 1.5], 14)
    counts = full * np.repeat(level, 24)
    _, cells = days(np.zeros(24), np.zeros(24), weeks=4)
    # Of 28 days, weekends apart, the variance is 1/4 less what 2400 people differ by by chance.
    found = learned(counts, np.tile(DAY_CELLS, 28))
    assert found.shape == pytest.approx((5 + 28) / (5 * 0.1 + 28 * (0.25 - 1 / 2400)))


@pytest.mark.parametrize(
    ("latest_s", "delay_s"),
    [
        ([10.0] * 20 + [4000.0], 15.0),  # once caught up after an outage
        ([3600.0, 3700.0, 3650.0], 3700.0 * 1.5),
        ([86_400.0] * 10, 86_400.0 + 7200.0),
        ([-3600.0] * 7, -3600.0),  # a clock that is an hour ahead
    ],
)
def test_how_late_tracks_come(latest_s, delay_s):
    assert delay_of(np.array(latest_s)) == pytest.approx(delay_s)


@pytest.mark.parametrize(
    "change", [{"rates": (1.0,) * 24}, {"rates": (-1.0,) * 48}, {"burst": 0.5}, {"shape": 0.0}]
)
def test_what_is_no_rhythm_is_refused(change):
    numbers = {"rates": (1.0,) * 48, "burst": 1.0, "shape": 1.0, "usual_gap_s": 1.0, "days": 7}
    with pytest.raises(ValueError, match=next(iter(change))):
        ArrivalProcess(**{**numbers, **change})


@pytest.mark.nightly
@pytest.mark.slow
def test_simulated_years_keep_the_rate_and_find_outages():
    results = study_rhythm(6, seed=1)
    assert sum(result.false_alerts for result in results) <= 6
    busy = [hours for r in results if r.noon_tracks > 30 for hours in r.noticed_h]
    assert busy
    assert max(busy) < 48  # even posted nightly
    assert describe(results).startswith("6 camera-years")
    assert study_rhythm(1, seed=1) == results[:1]
