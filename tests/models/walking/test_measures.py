"""Speeds and statures at a candidate pose: hand-made walks, derivatives, noise, the horizon."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.geometry.upright import tops_seen
from models.tracks.observations import of_tracks
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_each
from models.walking.measures import Measured, measure_speeds, measure_statures

LENS = Intrinsics(
    width=1280, height=720, fx=1000, fy=1000, cx=640, cy=360, distortion=(0.05, 0, 0, 0, 0)
)
POSE = CameraPose(height_m=6, tilt_rad=math.radians(25), roll_rad=0.05, heading_rad=0.4)
AHEAD = np.array([math.sin(0.4), math.cos(0.4)])
ASIDE = np.array([math.cos(0.4), -math.sin(0.4)])


def walk(
    speed_mps: float, *, direction: Array = ASIDE, seconds: float = 6.0, tall_m: float = 1.7
) -> Trajectory:
    """Someone who walks straight on, 12 m before the camera at half time."""
    time_s = np.arange(0, seconds + 1e-6, 0.3)
    ground = 12 * AHEAD + (time_s - seconds / 2)[:, None] * speed_mps * direction
    uv, valid = pixel_from_ground(LENS, POSE.rotation, POSE.centre_m, ground)
    assert valid.all()
    tops = tops_seen(LENS, POSE.rotation, POSE.centre_m, ground, np.full(len(ground), tall_m))
    return Trajectory(time_s=time_s, uv=uv, top_v=tops)


def speeds(tracks: list[Trajectory], candidate: Array) -> Measured:
    return measure_speeds(observe_each(tracks, LENS).steps, candidate, POSE.heading_rad)


def test_a_walk_at_even_speed_is_measured_as_such_at_the_true_pose():
    measured = speeds([walk(1.2), walk(0.8, direction=AHEAD)], plane_parameters_of(POSE))
    # 6 s are four steps of 1.5 s.
    assert_allclose(measured.rows.owner_idx, [0] * 4 + [1] * 4)
    assert_allclose(np.exp(measured.value), [1.2] * 4 + [0.8] * 4, rtol=5e-3)
    assert_allclose(measured.direction[:4], np.tile(ASIDE, (4, 1)), atol=5e-3)
    # The second step of the first walk ends at half time.
    assert_allclose(measured.place[1], 12 * AHEAD - 0.75 * 1.2 * ASIDE, atol=0.02)


def test_twice_the_height_is_twice_the_speed():
    at = plane_parameters_of(POSE)
    tracks = [walk(1.2)]
    low, high = speeds(tracks, at), speeds(tracks, at + [0, 0, math.log(2)])
    assert_allclose(high.value - low.value, math.log(2), atol=1e-6)
    assert_allclose(low.d_value[:, 2], 1, atol=1e-6)


def test_statures_are_those_of_the_people():
    tracks = [walk(1.2, tall_m=1.6), walk(0.8, tall_m=1.9)]
    tops = observe_each(tracks, LENS).tops
    measured = measure_statures(tops, plane_parameters_of(POSE), POSE.heading_rad)
    assert_allclose(np.exp(measured.value), [1.6] * 5 + [1.9] * 5, rtol=5e-3)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_derivatives_are_those_of_differences(number):
    tracks = [walk(1.2), walk(0.9, direction=AHEAD), walk(1.4, direction=(AHEAD + ASIDE) / 1.414)]
    observations = observe_each(tracks, LENS)
    at = plane_parameters_of(POSE) + [0.03, -0.05, 0.1]
    step = np.zeros(3)
    step[number] = 1e-6
    for measure, read in (
        (measure_speeds, observations.steps),
        (measure_statures, observations.tops),
    ):
        after = measure(read, at + step, 0.4)
        before = measure(read, at - step, 0.4)
        said = measure(read, at, 0.4)
        # A speed's derivative is that of a short step in the middle of it.
        tolerance = 0.005 if said.direction is not None else 1e-6
        slope = (after.value - before.value) / 2e-6
        assert_allclose(said.d_value[:, number], slope, atol=tolerance * np.abs(slope).max())
        place = (after.place - before.place) / 2e-6
        assert_allclose(said.d_place[:, :, number], place, atol=0.15)  # of 28 m per radian
        if said.direction is not None:
            turn = (after.direction - before.direction) / 2e-6
            assert_allclose(said.d_direction[:, :, number], turn, atol=1e-5)


def test_noise_in_a_speed_is_not_in_its_derivative():
    # Were it, steps that noise makes longer would pull at the pose, and many tracks would agree.
    rng = np.random.default_rng(0)
    clean = walk(1.2, direction=AHEAD, seconds=12)
    tracks = [
        Trajectory(time_s=clean.time_s, uv=clean.uv + rng.normal(0, 4, clean.uv.shape))
        for _ in range(400)
    ]
    measured = speeds(tracks, plane_parameters_of(POSE))
    for step in range(8):
        here = np.arange(len(measured.value)) % 8 == step
        shared = np.corrcoef(measured.value[here], measured.d_value[here, 0])[0, 1]
        assert abs(shared) < 0.2


def test_what_is_above_the_horizon_counts_for_nothing():
    measured = speeds([walk(1.2)], plane_parameters_of(POSE) - [math.radians(40), 0, 0])
    assert not measured.valid.any()
    assert_allclose(measured.value, 0)
    assert_allclose(measured.d_value, 0)


def test_a_choice_of_tracks_is_measured_as_if_alone():
    tracks = [walk(1.2), walk(0.8), walk(1.5)]
    some = of_tracks(observe_each(tracks, LENS), np.array([0, 2]))
    chosen = measure_speeds(some.steps, plane_parameters_of(POSE), 0.4)
    alone = speeds([tracks[0], tracks[2]], plane_parameters_of(POSE))
    assert_allclose(chosen.value, alone.value)
    assert_allclose(chosen.rows.owner_idx, alone.rows.owner_idx)


def test_a_gap_and_the_edge_of_the_picture_end_a_run():
    whole = walk(1.2, seconds=12)
    kept = (whole.time_s < 4.6) | (whole.time_s > 7.4)
    broken = Trajectory(time_s=whole.time_s[kept], uv=whole.uv[kept])
    rows = observe_each([broken], LENS).steps.rows
    assert_allclose(rows.linked, [False, True, True, False, True, True])
    outside = Trajectory(time_s=whole.time_s, uv=whole.uv + [0.0, 5000.0])
    assert observe_each([outside], LENS).walkers == 0
