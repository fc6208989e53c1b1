"""The drift chart: knocks found with their sign, a still camera left alone; by hand, on lanes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.assessment.scale_faults import may_be_clock
from models.errors import CheckpointError
from models.geometry.pose import array_of
from models.monitoring import chart_learning
from models.monitoring.chart import (
    CLOCK,
    OFFSET_GRID,
    DriftChart,
    GridOffset,
    chart_from_bytes,
    chart_to_bytes,
    highest,
    ratios_of,
    trace,
)
from models.monitoring.chart import chart_result as chart_result_by
from models.monitoring.chart_learning import drawn_blocks, learn_chart
from models.monitoring.config import LENGTHS
from models.monitoring.group_scores import SCORES, GroupScores, Usual, score_groups
from models.paths.folds import fold_maps
from models.paths.reference import learn_paths
from models.pose import estimate_pose, learn_site, observe
from models.simulation.walkers import WalkConfig
from models.tracks.observations import of_tracks
from models.tracks.trajectory import Trajectory, by_end
from models.tracks.walks import observe_each
from models.walking.reference_learning import learn_speed_reference
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import LENS, PRIOR

AT = array_of(PRIOR)
CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)
ONE_A_YEAR = 1000 / 36_500  # a run is 1000 walking groups: of 100 a day


def chart_result(chart, scores, alarms):
    return chart_result_by(chart, scores, alarms, calm_ratio=0.7, calm_groups=12)


def feet(tracks):
    """What is read of feet, in the order of the tracks' ends."""
    return observe_each(by_end(replace(track, top_v=None) for track in tracks), LENS)


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, CONFIG, np.random.default_rng(3))


def walk(lanes, pose, count, seed, config=CONFIG):
    return feet(walk_site(LENS, pose, lanes, config, count, np.random.default_rng(seed)))


@pytest.fixture(scope="module")
def learned(lanes):
    """A chart of 200 people, and what is usual by the same."""
    known = walk(lanes, PRIOR, 200, 4)
    site = learn_speed_reference(known, PRIOR, WalkConfig(), 0)
    folds = fold_maps(known, LENS, AT, 0)
    flow = learn_paths(known, LENS, PRIOR, 0, folds=folds)
    chart = learn_chart(known, PRIOR, site, folds, 0)
    return chart, Usual(prior=PRIOR, speed_reference=chart.speed_reference, paths=flow.model(LENS))


def turned(**by):
    names = {"tilt": "tilt_rad", "roll": "roll_rad", "heading": "heading_rad"}
    return replace(
        PRIOR, **{names[k]: getattr(PRIOR, names[k]) + math.radians(v) for k, v in by.items()}
    )


def plain(walking_groups=1e9, responses=None, typical=0.0):
    """A chart of independent scores of unit variance; one knock moves one of them by one."""
    if responses is None:
        responses = np.zeros((SCORES, len(OFFSET_GRID)))
    return DriftChart(
        speed_reference=None,
        middle=np.zeros(SCORES),
        width=np.ones(SCORES),
        mean=np.zeros(SCORES),
        covariance=np.eye(SCORES),
        responses=responses,
        walking_groups=walking_groups,
        typical=typical,
        tail=1.0,
    )


def far_heading():
    """A chart that knows one knock alone: 6 deg of heading adds 1 to the last score."""
    responses = np.zeros((SCORES, len(OFFSET_GRID)))
    responses[-1, OFFSET_GRID.index(GridOffset(parameter=3, size=math.radians(6)))] = 1.0
    return responses


def test_the_ratio_is_that_of_a_shift_by_hand():
    """Sixteen groups, 1.5 each of noise 1: n (1.5 x 1.5 - 1.5^2 / 2) = 18 at a strength of 1.5."""
    apart = np.zeros((16, SCORES))
    apart[:, -1] = 1.5
    path = trace(ratios_of(plain(responses=far_heading())), apart)
    assert path.statistic[-1] == pytest.approx(18.0)
    assert OFFSET_GRID[path.offset_idx[-1]].parameter == 3
    # A reference of 16 walking groups, counted one and a half times, is more unsure than they are.
    path = trace(ratios_of(plain(walking_groups=16.0, responses=far_heading())), apart)
    assert path.statistic[-1] == pytest.approx(18.0 / 2.5)


@pytest.mark.parametrize("count", [16, 90, 1000])
def test_the_highest_is_the_highest_of_the_trace(learned, count):
    chart, _ = learned
    ratios = ratios_of(chart)
    rng = np.random.default_rng(count)
    for size in (0.3, 1.0, 4.0):
        apart = rng.normal(rng.normal(0, size, SCORES), 1.0, (count, SCORES))
        expected = trace(ratios, apart).statistic.max()
        assert highest(ratios, apart) == pytest.approx(expected, rel=1e-12)
    assert highest(ratios, np.zeros((15, SCORES))) == -math.inf


def test_less_than_half_a_knock_never_adds_up():
    apart = np.zeros((400, SCORES))
    apart[:, -1] = 0.45
    path = trace(ratios_of(plain(responses=far_heading())), apart)
    assert path.statistic.max() < 0
    apart[:, -1] = 0.55
    path = trace(ratios_of(plain(responses=far_heading())), apart)
    assert path.statistic[-1] == pytest.approx(400 * (0.55 - 0.5))


def test_a_reference_of_few_is_never_contradicted_by_many():
    """Off by two of its standard errors, 0.5: no number of new groups makes that an alarm."""
    apart = np.zeros((5000, SCORES))
    apart[:, -1] = 0.5
    chart = plain(walking_groups=16.0, responses=far_heading())
    assert trace(ratios_of(chart), apart).statistic.max() < chart.level(ONE_A_YEAR)


def test_the_newest_groups_count_and_say_since_when():
    chart = plain(responses=far_heading())
    values = np.zeros((100, SCORES))
    values[70:, -1] = 2.0
    result = chart_result(chart, GroupScores(values=values, last=np.arange(100) * 3), ONE_A_YEAR)
    assert (result.parameter, result.sign, result.moved) == (3, 1, True)
    assert result.walking_groups in LENGTHS
    assert result.track_idx == pytest.approx(210, abs=15)
    few = GroupScores(values=values[:15], last=np.arange(15))
    assert chart_result(chart, few, ONE_A_YEAR) is None


def test_it_matters_not_after_which_group_it_is_read():
    """An alarm among walking groups stays one until the chart has been calm for a dozen."""
    chart = plain(responses=far_heading())
    values = np.zeros((160, SCORES))
    values[30:60, -1] = 2.0
    path = trace(ratios_of(chart), values)
    level = chart.level(ONE_A_YEAR)
    first = int(np.flatnonzero(path.statistic > level)[0])
    fell = first + int(np.flatnonzero(path.statistic[first:] < 0.7 * level)[0])

    def read(count):
        return chart_result(
            chart, GroupScores(values=values[:count], last=np.arange(count)), ONE_A_YEAR
        )

    assert not read(first).moved
    for count in range(first + 1, fell + 12):
        assert read(count).moved
    assert read(fell + 11).statistic == pytest.approx(path.statistic.max())
    calmed = read(fell + 12)
    assert not calmed.moved
    assert calmed.excess == pytest.approx(path.statistic[fell + 11] / level)


def test_no_group_counts_for_more_than_five_of_its_kind():
    values = np.zeros((60, SCORES))
    values[-1, -1] = 1e6
    result = chart_result(
        plain(responses=far_heading()), GroupScores(values=values, last=np.arange(60)), ONE_A_YEAR
    )
    assert not result.moved


def test_rarer_alarms_need_more_and_few_groups_too():
    chart = plain(walking_groups=1e9, typical=6.0)
    # Where half of the runs pass 6 and excesses are 1 on average, one in 100 passes 6 + ln 50.
    assert chart.level(-math.log(0.99)) == pytest.approx(max(6 + math.log(50), 5.4 + math.log(100)))
    assert chart.level(1e-4) > chart.level(1e-2) > chart.level(1.0)
    few = replace(chart, walking_groups=30.0)
    assert few.level(0.1) == pytest.approx(chart.level(0.1) * 29 / 14)


def test_bytes_give_the_chart_back_and_others_are_refused(learned):
    chart, _ = learned
    again = chart_from_bytes(chart_to_bytes(chart))
    np.testing.assert_array_equal(again.responses, chart.responses)
    np.testing.assert_array_equal(
        again.speed_reference.speeds.mean, chart.speed_reference.speeds.mean
    )
    assert (again.typical, again.tail, again.walking_groups) == (
        chart.typical,
        chart.tail,
        chart.walking_groups,
    )
    with pytest.raises(CheckpointError):
        chart_from_bytes(b"no chart")
    with pytest.raises(CheckpointError, match="offsets are needed"):
        chart_from_bytes(chart_to_bytes(replace(chart, responses=chart.responses[:, :5])))


@pytest.mark.parametrize(
    ("move", "parameter", "sign"),
    [
        ({"heading": 5}, 3, 1),
        ({"heading": -5}, 3, -1),
        ({"tilt": 4}, 0, 1),
        ({"tilt": -4}, 0, -1),
        ({"roll": 4}, 1, 1),
        ({"roll": -4}, 1, -1),
    ],
)
def test_a_knock_is_found_with_its_sign_within_sixty_tracks(lanes, learned, move, parameter, sign):
    chart, usual = learned
    result = chart_result(
        chart, score_groups(walk(lanes, turned(**move), 60, 5), usual), ONE_A_YEAR
    )
    assert result.moved
    assert (result.parameter, result.sign) == (parameter, sign)


def test_a_still_camera_is_not_taken_for_moved(lanes, learned):
    chart, usual = learned
    scores = score_groups(walk(lanes, PRIOR, 900, 7), usual)
    path = trace(ratios_of(chart), chart.bounded(scores.values) - chart.mean)
    assert path.statistic.max() < chart.level(ONE_A_YEAR)


def test_of_one_walk_over_and_over_there_is_no_chart():
    """A video in a loop: nobody differs from anybody, so that chance has no measure."""
    time_s = 0.5 * np.arange(16)
    uv = np.column_stack([300 + 64 * time_s, np.full(16, 400.0)])
    loop = [Trajectory(time_s=60.0 * n + time_s, uv=uv) for n in range(60)]
    site = learn_site(observe(loop, LENS, PRIOR), LENS, PRIOR)
    assert site.chart is None
    found = estimate_pose(observe(loop, LENS, PRIOR), site)
    assert found.pose.tilt_rad == pytest.approx(PRIOR.tilt_rad, abs=1e-6)


def test_people_in_the_rain_are_not_a_knock(lanes, learned):
    """Everybody 4 % faster for 300 people: the height is in doubt, and no alarm."""
    chart, usual = learned
    rainy = replace(CONFIG, speed_mean_mps=CONFIG.speed_mean_mps * 1.04)
    result = chart_result(chart, score_groups(walk(lanes, PRIOR, 300, 8, rainy), usual), ONE_A_YEAR)
    assert not result.moved


def test_a_scale_waits_until_it_can_be_called_the_clock(lanes, learned):
    """Frames of 30 a second taken for 25: everybody is slow, as before a higher camera."""
    chart, usual = learned
    fast = walk_site(LENS, PRIOR, lanes, CONFIG, 150, np.random.default_rng(9))
    slow = feet([replace(t, time_s=t.time_s[0] + (t.time_s - t.time_s[0]) * 1.2) for t in fast])
    result = chart_result(chart, score_groups(slow, usual), ONE_A_YEAR)
    assert result.moved
    assert (result.parameter, result.sign) == (CLOCK, 1)
    assert not may_be_clock(result)  # by now a pose can tell
    early = chart_result(chart, score_groups(of_tracks(slow, np.arange(20)), usual), ONE_A_YEAR)
    assert may_be_clock(early)


def test_in_a_crowd_answers_are_learned_of_so_many_groups(lanes):
    """Who walks with whom there hangs on who else is asked: a few of them are other groups."""
    people = walk_site(LENS, PRIOR, lanes, CONFIG, 400, np.random.default_rng(7))
    begun_s = people[0].time_s[0]
    crowd = feet(replace(t, time_s=t.time_s - 0.985 * (t.time_s[0] - begun_s)) for t in people)
    site = learn_speed_reference(crowd, PRIOR, WalkConfig(), 0)
    first = fold_maps(crowd, LENS, AT, 0).each[0]
    for wanted in (5, 10, 15, 20):
        scores = chart_learning._fold_scores(crowd, PRIOR, site, first, wanted)
        assert len(scores.still) > 20
        assert len(scores.before) == wanted
        assert scores.offset.shape == (len(OFFSET_GRID), wanted, SCORES)


@pytest.mark.parametrize(("groups", "together"), [(1000, 24), (100, 9), (13, 2)])
def test_people_of_a_quarter_of_an_hour_stay_together_where_the_reference_has_several(
    groups, together
):
    drawn = drawn_blocks(np.random.default_rng(0), groups, 40 * together).reshape(40, together)
    assert (np.diff(drawn, axis=1) % groups == 1).all()
    assert ((drawn[1:, 0] - drawn[:-1, -1]) % groups != 1).sum() > 20  # the next begins anywhere
