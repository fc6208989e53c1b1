"""Days before cameras that stand: what alarms, and how much people's habits move."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.monitoring.chart import OFFSET_GRID, DriftChart
from models.monitoring.group_scores import SCORES
from models.pose import assume_site, observe
from models.tracks.scenes import Scene, SceneTrack
from studies.alarms import still_days as study
from studies.alarms.still_days import MOVES, StillDay, habits_of, report_lines
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import LENS, PRIOR

pytestmark = pytest.mark.slow

A_UNIT = 50.0  # of scores, for a radian and for a log


@pytest.fixture(scope="module")
def scene() -> Scene:
    config = SiteConfig(aside_m=0.8)
    rng = np.random.default_rng(4)
    walks = walk_site(LENS, PRIOR, draw_lanes(LENS, PRIOR, config, rng), config, 620, rng)
    tracks = tuple(
        SceneTrack(track_id=str(number), trajectory=walk, person_id=str(number))
        for number, walk in enumerate(walks)
    )
    return Scene(
        scene_id="made", intrinsics=LENS, true_pose=PRIOR, frame_rate_hz=2.5, tracks=tracks
    )


def chart_of_five(scene: Scene) -> DriftChart:
    """One whose first five scores tell tilt, roll, height, heading and pace, with a noise of 1."""
    responses = np.zeros((SCORES, len(OFFSET_GRID)))
    for number, knock in enumerate(OFFSET_GRID):
        responses[knock.parameter, number] = A_UNIT * knock.size
    walks = [track.trajectory for track in scene.tracks[:20]]
    return DriftChart(
        speed_reference=assume_site(observe(walks, LENS, PRIOR), LENS, PRIOR).speed_reference,
        middle=np.zeros(SCORES),
        width=np.ones(SCORES),
        mean=np.zeros(SCORES),
        covariance=np.eye(SCORES),
        responses=responses,
        walking_groups=500.0,
        typical=5.0,
        tail=1.0,
    )


def test_habits_are_what_moves_blocks_beyond_chance(scene):
    chart, rng = chart_of_five(scene), np.random.default_rng(0)
    drawn = np.array([0.005, 0.02, 0.0, 0.01, 0.05])
    blocks = np.zeros((200, 1, SCORES))
    blocks[..., :5] = A_UNIT * drawn * rng.standard_normal((200, 1, 5))
    apart = (blocks + rng.standard_normal((200, 100, SCORES))).reshape(-1, SCORES)
    # Of 200 blocks a standard deviation is known to 5 %; chance moves one by 0.1 / 50.
    assert_allclose(habits_of(chart, apart)[[0, 1, 3, 4]], drawn[[0, 1, 3, 4]], rtol=0.15)
    assert habits_of(chart, apart)[2] < 0.1 / A_UNIT


def test_a_day_of_people_as_ever_is_quiet_and_a_move_in_it_is_heard(scene, monkeypatch):
    monkeypatch.setattr(study, "_REFERENCE", 250)
    monkeypatch.setattr(study, "_FEWEST", 300)
    (day,) = study.still_days(scene, alarms_a_year=1.0)  # from 1,500 on, nobody is left
    assert day.camera == "made"
    assert 320 < day.tracks <= 370
    assert day.alarm_after is None
    assert day.excess < 1
    # A pan of 2 deg is hardly beyond what so small a reference knows.
    leaned = [each for move, each in day.delays.items() if not move.startswith(("pan", "roll"))]
    assert (np.median(leaned, axis=1) < 60).all()


def test_what_is_told_counts_alarms_and_names_delays():
    day = StillDay(
        camera="made",
        begin=0,
        tracks=700,
        excess=0.5,
        offset_idx=0,
        alarm_after=None,
        habits=np.array([math.radians(0.1), math.radians(0.2), 0.01, math.radians(0.3), 0.04]),
        delays={move: [10.0, 20.0, 30.0, np.inf] for move in MOVES},
    )
    lines = list(report_lines([day, replace(day, alarm_after=650, excess=1.5)]))
    assert "0.10, 0.20, 1.00, 0.30, 4.00" in lines[0]
    assert "alarms: 1 of 2, while still" in lines
    assert "pan +2 deg: 30 walking groups in the median, inf in 80 %" in lines
