"""The virtual knock: halves by person, exact moves, honest judging."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.upright import statures
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory
from studies.protocol.cases import (
    HARD,
    KNOCKED,
    PANNED,
    STILL,
    Answer,
    draw_case,
    judge_answer,
)

LENS = Intrinsics(width=1280, height=720, fx=1000, fy=1000, cx=640, cy=360)
POSE = CameraPose(height_m=6, tilt_rad=math.radians(25), roll_rad=0.02, heading_rad=0.4)


@pytest.fixture(scope="module")
def scene() -> Scene:
    rng = np.random.default_rng(0)
    walks = simulate_walks(LENS, repeated_pose(POSE, 60), WalkConfig(), rng)
    tracks = []
    for number, (padded, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        uv = padded[:length]
        trajectory = Trajectory(
            time_s=100.0 * number + 0.4 * np.arange(length), uv=uv, top_v=uv[:, 1] - 100.0
        )
        tracks.append(
            SceneTrack(track_id=str(number), trajectory=trajectory, person_id=str(number // 2))
        )
    return Scene(
        scene_id="simulated",
        intrinsics=LENS,
        true_pose=POSE,
        frame_rate_hz=25,
        tracks=tuple(tracks),
    )


def test_no_person_is_in_both_halves(scene):
    case = draw_case(scene, 3, STILL)
    starts = {track.trajectory.time_s[0]: track.person_id for track in scene.tracks}
    first = {starts[trajectory.time_s[0]] for trajectory in case.reference}
    second = {track.person_id for track in scene.tracks} - first
    assert len(first) == len(second) == 15
    assert {starts[100.0 * (t.time_s[0] // 100)] for t in case.seen} <= second


def test_a_knock_keeps_feet_on_their_place_and_people_as_tall(scene):
    case = draw_case(scene, 1, KNOCKED)
    by_time = {time: track.trajectory for track in scene.tracks for time in track.trajectory.time_s}
    assert len(case.seen) > 20
    for seen in case.seen:
        before = by_time[seen.time_s[0]]
        rows = np.searchsorted(before.time_s, seen.time_s)
        ground = []
        for pose, uv in ((case.true_pose, seen.uv), (POSE, before.uv[rows])):
            ground.append(ground_from_pixel(LENS, pose.rotation, pose.centre_m, uv)[0])
        assert_allclose(ground[0], ground[1], atol=1e-6)
        tall, valid = statures(
            LENS, case.true_pose.rotation, case.true_pose.height_m, seen.uv, seen.top_v
        )
        tall_before, _ = statures(
            LENS, POSE.rotation, POSE.height_m, before.uv[rows], before.top_v[rows]
        )
        assert_allclose(tall[valid], tall_before[valid], rtol=1e-6)
        assert LENS.contains(seen.uv).all()


def test_the_same_seed_knocks_the_same_way_and_hard_knocks_go_farther(scene):
    still, knock, hard = (draw_case(scene, 5, reach) for reach in (STILL, KNOCKED, HARD))
    drift = plane_parameters_of(knock.true_pose) - plane_parameters_of(POSE)
    assert_allclose(plane_parameters_of(still.true_pose), plane_parameters_of(POSE), atol=1e-12)
    assert np.abs(drift[:2]).max() <= math.radians(8)
    assert abs(drift[2]) <= 0.15
    hard_drift = plane_parameters_of(hard.true_pose) - plane_parameters_of(POSE)
    assert_allclose(hard_drift / drift, [15 / 8, 15 / 8, 0.35 / 0.15], rtol=1e-9)


def test_a_move_midway_leaves_the_first_half_as_the_still_camera_saw_it(scene):
    whole, midway, still = (
        draw_case(scene, 1, reach, still_share=share)
        for reach, share in ((KNOCKED, 0.0), (KNOCKED, 0.5), (STILL, 0.0))
    )
    assert midway.true_pose == whole.true_pose

    def by_start(case):
        return {float(track.time_s[0]) // 100: track.uv.round(6).tolist() for track in case.seen}

    seen, moved, unmoved = by_start(midway), by_start(whole), by_start(still)
    as_before = {time for time, uv in seen.items() if unmoved.get(time) == uv}
    as_after = {time for time, uv in seen.items() if moved.get(time) == uv}
    assert set(seen) == as_before | as_after
    assert max(as_before) < min(as_after)
    assert min(len(as_before), len(as_after)) >= 13


def test_an_answer_is_judged_by_hand_derived_numbers(scene):
    case = draw_case(scene, 5, KNOCKED)
    truth = plane_parameters_of(case.true_pose)
    off = np.array([math.radians(1), 0.0, math.log(1.1)])
    sd = np.array([math.radians(0.7), math.radians(1), 0.05])
    answer = Answer(
        values=truth + off, covariance=np.diag(sd**2), tracks=40, identifiable=("roll", "height")
    )
    outcome = judge_answer(case, "joint", answer, 0.1)
    assert outcome.angle_error_deg == pytest.approx(1.0, abs=1e-6)
    assert outcome.height_error == pytest.approx(0.1)
    # 1 deg is 1.43 sd of 0.7 deg: inside 1.645; log 1.1 = 0.0953 is 1.91 sd of 0.05: outside.
    assert outcome.covered == (True, True, False)
    assert outcome.degenerate
    assert np.subtract(outcome.drift, outcome.true_drift) == pytest.approx(
        [1, 0, 0.09531], abs=1e-5
    )


def test_a_pan_changes_nothing_else_and_its_error_is_the_whole_rotations(scene):
    plain, turned = draw_case(scene, 4, KNOCKED), draw_case(scene, 4, PANNED)
    assert_allclose(plane_parameters_of(turned.true_pose), plane_parameters_of(plain.true_pose))
    pan_deg = math.degrees(turned.true_pose.heading_rad - POSE.heading_rad)
    assert 0 < abs(pan_deg) <= 8
    right = Answer(
        values=plane_parameters_of(turned.true_pose), covariance=np.eye(3) * 1e-6, tracks=9
    )
    blind = judge_answer(turned, "blind", right, 0.0)
    # A turn about the vertical is a turn by as much, however the camera is tilted.
    assert blind.angle_error_deg == pytest.approx(abs(pan_deg), rel=1e-6)
    assert blind.heading_error_deg is None
    assert blind.tilt_roll_error_deg == pytest.approx(0, abs=1e-6)
    assert blind.true_heading_drift_deg == pytest.approx(pan_deg)
    seeing = replace(
        right, heading_rad=turned.true_pose.heading_rad + math.radians(0.5), heading_sd_rad=0.004
    )
    told = judge_answer(turned, "seeing", seeing, 0.0)
    assert told.heading_error_deg == pytest.approx(0.5)
    assert told.angle_error_deg == pytest.approx(0.5)
    assert told.heading_covered is False
    rolled = replace(seeing, values=seeing.values + [0, math.radians(1), 0])
    both = judge_answer(turned, "both", rolled, 0.0)
    # A turn of 0.5 deg about the vertical and of 1 deg about the axis, `tilt` below the horizon:
    # as vectors the angle between them is 90 deg less the tilt, up or down.
    assert both.tilt_roll_error_deg == pytest.approx(1.0)
    shared = 2 * 0.5 * math.sin(turned.true_pose.tilt_rad)
    ends = [math.sqrt(1.25 + sign * shared) for sign in (1, -1)]
    assert min(abs(both.angle_error_deg - end) for end in ends) < 1e-2
