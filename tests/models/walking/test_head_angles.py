"""LeanAngles: numbers by hand, OpenCV's projection of poles, and what has no lean at all."""

import math

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.tracks.observations import HeadFootPairs
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_heads
from models.walking.head_angles import measure_lean_angles

LENS = Intrinsics(
    width=1920, height=1080, fx=1300, fy=1250, cx=950, cy=560, distortion=(-0.2, 0.05, 1e-3, 0, 0)
)
POSE = CameraPose(
    height_m=6.0,
    tilt_rad=math.radians(24),
    roll_rad=math.radians(-5),
    heading_rad=math.radians(70),
    x_m=2.0,
    y_m=-1.0,
)


def rays_of(feet, heads):
    """HeadFootPairs of rays alone, each of a track of its own."""
    feet, heads = np.array(feet, float), np.array(heads, float)
    columns = np.column_stack([feet[:, 0], heads[:, 1], np.ones(len(feet))])
    return HeadFootPairs(
        foot_rays=feet, head_rays=heads, column_rays=columns, from_rays=feet, to_rays=feet,
        owner_idx=np.arange(len(feet)), owners=len(feet),
    )  # fmt: skip


def seen_by_opencv(points_m, pose=POSE, lens=LENS):
    """Pixels (N, 2) of world points (N, 3)."""
    rotation, translation = pose.rotation, pose.translation_m
    distortion = np.array(lens.distortion)
    uv, _ = cv2.projectPoints(
        np.asarray(points_m, float),
        cv2.Rodrigues(rotation)[0],
        translation,
        lens.matrix,
        distortion,
    )
    return uv.reshape(-1, 2)


def poles(lean_rad=0.0, pose=POSE):
    """Feet (N, 3) before a camera, and heads that lean to the right as it sees them."""
    away, aside = np.meshgrid([9.0, 14.0, 22.0], [-4.0, 0.0, 5.0])
    heading = pose.heading_rad
    forward = np.array([math.sin(heading), math.cos(heading)])
    right = np.array([forward[1], -forward[0]])
    ground = np.array([pose.x_m, pose.y_m]) + away.reshape(-1, 1) * forward
    ground = ground + aside.reshape(-1, 1) * right
    view = ground - (pose.x_m, pose.y_m)
    across = np.stack([view[:, 1], -view[:, 0]], 1) / np.linalg.norm(view, axis=1)[:, None]
    feet = np.column_stack([ground, np.zeros(len(ground))])
    heads = feet + 1.7 * np.column_stack(
        [math.sin(lean_rad) * across, np.full(len(ground), math.cos(lean_rad))]
    )
    return feet, heads


def standing(feet_uv, heads_uv):
    """A track that stands, seen three times, for each pair of pixels."""
    return [
        Trajectory(
            time_s=np.arange(3) * 0.4, uv=np.tile(foot, (3, 1)), head_uv=np.tile(head, (3, 1))
        )
        for foot, head in zip(feet_uv, heads_uv, strict=True)
    ]


def test_a_level_camera_sees_leans_as_they_are_in_the_picture():
    # Straight ahead of a level camera a head 0.1 above and 0.02 right of its foot leans by
    # atan(0.2) = 11.31 deg; the plane through both and the camera is nearly as steep.
    found = measure_lean_angles(rays_of([(0, 0.2, 1)], [(0.02, 0.1, 1)]), np.zeros(2))
    # n = f x h = (0.1, 0.02, -0.004) and g = (0, -1, 0): 0.02 / |n|.
    assert_allclose(found.value, 0.02 / math.sqrt(0.1**2 + 0.02**2 + 0.004**2), rtol=1e-12)
    assert found.valid.all()
    # Heads that are right above their feet are as upright as can be.
    assert_allclose(found.column, 0, atol=1e-12)


def test_a_camera_rolled_clockwise_sees_people_lean_to_the_left():
    # Its right side is lower: in the picture verticals lean left, and who is upright there leans
    # right by the roll.
    found = measure_lean_angles(
        rays_of([(0, 0.2, 1)], [(0, 0.1, 1)]), np.array([0.0, math.radians(5)])
    )
    assert_allclose(np.degrees(np.arcsin(found.value)), 5.0, atol=1e-9)


@pytest.mark.parametrize("lean_deg", [0.0, 3.0, -8.0])
def test_what_opencv_projects_leans_as_it_does(lean_deg):
    feet, heads = poles(math.radians(lean_deg))
    pairs = observe_heads(standing(seen_by_opencv(feet), seen_by_opencv(heads)), LENS)
    assert len(pairs) > 4
    angles = np.array([POSE.tilt_rad, POSE.roll_rad])
    found = measure_lean_angles(pairs, angles)
    assert_allclose(np.degrees(np.arcsin(found.value)), lean_deg, atol=0.02 + abs(lean_deg) / 8)
    # Whatever the height and the heading: neither is asked for.
    assert found.valid.all()
    assert np.abs(np.degrees(found.column)).max() > 5


def test_derivatives_are_those_of_the_value():
    feet, heads = poles(math.radians(2))
    pairs = observe_heads(standing(seen_by_opencv(feet), seen_by_opencv(heads)), LENS)
    angles, step = np.array([0.3, 0.05]), 1e-6
    for number in (0, 1):
        by = step * np.eye(2)[number]
        apart = (
            measure_lean_angles(pairs, angles + by).value
            - measure_lean_angles(pairs, angles - by).value
        )
        found = measure_lean_angles(pairs, angles).jacobian[:, number]
        assert_allclose(found, apart / 2 / step, atol=1e-8)


def test_a_camera_that_looks_straight_down_sees_verticals_run_outwards():
    down = np.array([math.pi / 2, 0.0])
    feet = np.array([(0.2, 0.1, 1), (-0.3, 0.2, 1), (0, -0.4, 1)])
    outwards = feet * (1.3, 1.3, 1)
    found = measure_lean_angles(rays_of(feet, outwards), down)
    assert_allclose(found.value, 0, atol=1e-12)
    # Right under the camera a foot is its head: nothing is told, and nothing is not finite.
    under = measure_lean_angles(rays_of([(0, 0, 1)], [(0, 0, 1)]), down)
    assert not under.valid.any()
    assert (under.value, under.column) == (0, 0)
    assert_allclose(under.jacobian, 0)


def test_feet_above_the_horizon_tell_nothing():
    found = measure_lean_angles(
        rays_of([(0, -0.2, 1), (0, 0.2, 1)], [(0, -0.3, 1), (0, 0.1, 1)]), np.zeros(2)
    )
    assert found.valid.tolist() == [False, True]
    assert found.value[0] == 0


@pytest.mark.parametrize(
    "head",
    [
        (900.0, 700.0),  # is the foot
        (900.0, 740.0),  # below it
        (900.0, 694.0),  # six pixels from it
        (900.0, 0.5),  # cut by the border
        (1919.0, 300.0),
        (math.nan, math.nan),
    ],
)
def test_heads_that_tell_nothing_are_left_out(head):
    assert len(observe_heads(standing([(900.0, 700.0)], [head]), LENS)) == 0
    good = standing([(900.0, 700.0)], [(905.0, 600.0)])
    assert len(observe_heads(good, LENS)) == 1


def test_who_is_seen_for_long_counts_once_in_a_stride():
    time_s = 5.0 + np.arange(75) / 25  # 3 s
    uv = np.column_stack([np.linspace(500, 800, 75), np.full(75, 700.0)])
    walks = [
        Trajectory(time_s=time_s, uv=uv, head_uv=uv - (0, 100)),
        Trajectory(time_s=time_s, uv=uv),
        Trajectory(time_s=time_s, uv=uv, head_uv=uv - (0, 90)),
    ]
    found = observe_heads(walks, LENS)
    assert found.owner_idx.tolist() == [0, 0, 2, 2]
    assert found.owners == 3
    assert found.tracks.tolist() == [0, 2]
    last = found.of_tracks(np.array([1, 2]))
    assert (last.owner_idx.tolist(), last.owners) == ([1, 1], 2)
    assert_allclose(last.head_rays, found.head_rays[2:])
    # Who walks to the right walks sideways, whatever the pose.
    assert (measure_lean_angles(found, np.array([0.4, 0.0])).sideways > 0.9).all()
