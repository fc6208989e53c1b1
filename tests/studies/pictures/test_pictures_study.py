"""What the study of pictures does to a photograph, and what its tables say of trials."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from models.geometry.pose import pose_from_centre
from models.pictures.features import describe
from models.pictures.turn import turn_between
from models.pose import turn_by_pose
from studies.pictures.moves import MoveTrial, known_turn
from studies.pictures.tables import moves_table, pairs_table, turns_table
from studies.pictures.trials import PRIOR, PairTrial, TurnTrial, moved_by, shared_of
from studies.pictures.weather import SIZE, Weather, lens, taken, turned
from tests.models.pictures.given import wall


def picture(seed):
    return wall(seed, lens())


def test_a_turn_moves_the_middle_by_the_focal_length_times_its_tangent():
    grey = np.zeros(SIZE[::-1], np.uint8)
    grey[355:365, 635:645] = 255  # about the middle, 639.5, 359.5
    rotation = cv2.Rodrigues(np.array([0.0, math.radians(-5.0), 0.0]))[0]  # looks right by 5 deg
    seen = turned(grey, np.zeros_like(grey), rotation)
    u = float((seen.sum(axis=0) * np.arange(SIZE[0])).sum() / seen.sum())
    assert u == pytest.approx(639.5 - 980 * math.tan(math.radians(5.0)), abs=0.5)
    assert shared_of(np.eye(3)) == 1
    # The left edge, at -33.13 deg, is where -28.13 deg was: 116 of 1,280 px are gone, and corners.
    assert 0.87 < shared_of(rotation) < 1 - 115 / 1280


def test_people_are_within_their_boxes_and_cover_no_more_than_is_said():
    plain, other = np.full(SIZE[::-1], 100, np.uint8), picture(5)
    sent, boxes = taken(plain, Weather(noise=0.0, quality=95, covered=0.2, seed=3), [other])
    covered = np.zeros(sent.shape, bool)
    for x1, y1, x2, y2 in boxes.astype(int).tolist():
        covered[y1:y2, x1:x2] = True
    assert 0.05 < covered.mean() < 0.3
    outside = ~cv2.dilate(covered.astype(np.uint8), np.ones((17, 17))).astype(bool)
    assert np.abs(sent[outside].astype(int) - 100).max() <= 3


def test_bad_weather_before_a_camera_that_stands_is_no_move():
    bad = Weather(gamma=2.5, noise=8.0, quality=40, rain=400, covered=0.2, clock=True, seed=4)
    good = Weather(clock=True, lorry=True, seed=9)
    seen = [describe(taken(picture(1), weather, [picture(2)])[0]) for weather in (good, bad)]
    turn = turn_between(*seen, lens())
    assert turn is None or moved_by(turn) < 0.1


def test_tables_say_how_many_and_how_far_off():
    trials = [
        TurnTrial(
            photograph="a",
            turn_rad=0.1,
            shared=0.9,
            error_rad=math.radians(error),
            off_sd=(0.1, 2.0, 1.0),
            inliers=50,
            shifted=False,
        )
        for error in (0.1, 0.2, 0.3)
    ]
    lost = TurnTrial(
        photograph="b",
        turn_rad=0.1,
        shared=0.9,
        error_rad=None,
        off_sd=(),
        inliers=0,
        shifted=False,
    )
    assert "| 50 to 100 % | 4 | 75.0 % | 0.200° | 0.28° | 0.30° | 66.7 % |" in turns_table(
        [*trials, lost]
    )
    still = [PairTrial(pair=("a", "b"), turn_rad=0.001, moved=0.02, inliers=90)] * 3
    assert "0 false moves (at most 1.0e+00 of pairs at 95 %)" in pairs_table(still, [None])
    false = PairTrial(pair=("a", "c"), turn_rad=0.1, moved=0.999, inliers=9)
    assert "a and c: 5.73°" in pairs_table([*still, false], [None])


@pytest.mark.parametrize("angles", [1, 2, 3])
def test_a_known_turn_is_of_its_size_in_so_many_angles_of_the_pose(angles):
    turn = known_turn(1.3, angles, np.random.default_rng(angles))
    assert math.degrees(np.linalg.norm(cv2.Rodrigues(turn)[0])) == pytest.approx(1.3, abs=0.01)
    after = pose_from_centre(turn @ PRIOR.rotation, PRIOR.centre_m)
    changed = np.abs(np.degrees(turn_by_pose(PRIOR, after))) > 0.1
    assert changed.sum() == angles


def test_the_table_of_moves_counts_alerts_by_one_image_and_by_three():
    trial = MoveTrial(
        light="other hours",
        size_deg=1.3,
        angles=3,
        inliers=370,
        one=0.98,
        three=0.9999,
        one_alerts=False,
        three_alert=True,
    )
    lost = replace(trial, inliers=0, one=0.0, three=0.0, three_alert=False)
    text = moves_table([trial, trial, lost])
    assert "| other hours | 1.3° | 3 | 3 | 370 | 0.9800 | 0 | 0.9999 | 2 |" in text
