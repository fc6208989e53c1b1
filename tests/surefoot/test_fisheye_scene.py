"""A recorded scene as a fisheye would have seen it: the same pose, in every room."""

import math
from dataclasses import replace

import numpy as np
import pytest

import surefoot
from models.pose import self_calibrate
from models.simulation.poses import offset_trajectory
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import load_scene
from models.tracks.trajectory import by_end
from tests.conftest import SCENES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}"),
]
MARGIN_PX = 40.0
BENT = (0.05, -0.02, 0.01, -0.002)
KNOCK = {"tilt_rad": math.radians(5.0), "roll_rad": math.radians(-3.0), "height_m": -0.4}


@pytest.fixture(scope="module")
def scene():
    """The scene as a lens without distortion would have seen it."""
    found = load_scene(SCENES / "town_centre")
    return straightened(found)


def straightened(scene):
    own = replace(scene.intrinsics, distortion=())
    tracks = [
        replace(each, trajectory=seen)
        for each in scene.tracks
        for seen in within(own, through(own, scene, [each.trajectory]))
    ]
    return replace(scene, intrinsics=own, tracks=tuple(tracks))


@pytest.fixture(scope="module")
def fisheye(scene):
    return fisheye_of(scene.intrinsics)


def fisheye_of(own):
    """A fisheye whose picture, as large, ends where another one does in the middle of each side."""
    unit = replace(own, fx=1, fy=1, cx=0, cy=0, projection="fisheye", distortion=BENT)
    size = np.array([own.width, own.height]) - 0.5
    edges = np.array([[-0.5, own.cy], [own.cx, -0.5], [size[0], own.cy], [own.cx, size[1]]])
    (left, _), (_, top), (right, _), (_, bottom) = unit.project(own.rays(edges)[0])[0]
    fx, fy = own.width / (right - left), own.height / (bottom - top)
    return replace(unit, fx=fx, fy=fy, cx=-0.5 - fx * left, cy=-0.5 - fy * top)


def within(lens, people):
    """Those parts of people that are well inside the picture: the two end elsewhere at corners."""
    parts = [
        each.part(seen)
        for each in people
        if (seen := np.flatnonzero(lens.contains(each.uv, margin_px=-MARGIN_PX))).size
    ]
    return [each for each in parts if each.long_enough]


def people_of(scene):
    return by_end(each.trajectory for each in scene.tracks)


def knocked(scene, people, moved):
    seen = (offset_trajectory(each, scene.intrinsics, scene.true_pose, moved) for each in people)
    return within(scene.intrinsics, [each for each in seen if each is not None])


def through(lens, scene, people):
    """People as another lens sees them; of boxes the middle of the top is carried over."""

    def seen(uv):
        return lens.project(scene.intrinsics.rays(uv)[0])[0]

    return [
        replace(
            each,
            uv=seen(each.uv),
            top_v=None
            if each.top_v is None
            else seen(np.column_stack([each.uv[:, 0], each.top_v]))[:, 1],
        )
        for each in people
    ]


def served(lens, scene, before, after):
    known = surefoot.Pose.of(scene.true_pose)
    first, second = (
        [surefoot.Track(time_s=each.time_s, uv=each.uv) for each in people]
        for people in (before, after)
    )
    site = surefoot.learn(surefoot.Camera(intrinsics=lens, prior_pose=known), first)
    return surefoot.estimate(site, second).pose


def test_a_knock_gives_the_same_pose(scene, fisheye):
    true = scene.true_pose
    moved = replace(true, **{name: getattr(true, name) + by for name, by in KNOCK.items()})
    people = people_of(scene)
    before, after = people[: len(people) // 2], knocked(scene, people[len(people) // 2 :], moved)
    own = served(scene.intrinsics, scene, before, after)
    seen = (through(fisheye, scene, each) for each in (before, after))
    ours = served(fisheye, scene, *seen)
    assert abs(own.tilt_deg - math.degrees(moved.tilt_rad)) < 1.0  # it is no prior pose
    assert ours.tilt_deg == pytest.approx(own.tilt_deg, abs=0.05)
    assert ours.roll_deg == pytest.approx(own.roll_deg, abs=0.05)
    assert ours.heading_deg == pytest.approx(own.heading_deg, abs=0.05)
    assert ours.height_m == pytest.approx(own.height_m, rel=0.005)


@pytest.mark.parametrize("boxes", [False, True])
def test_people_alone_propose_the_same_pose(scene, fisheye, boxes):
    people = people_of(scene)
    if not boxes:
        people = [replace(each, top_v=None) for each in people]
    own = self_calibrate(people, scene.intrinsics, WalkConfig(), {}).values
    ours = self_calibrate(through(fisheye, scene, people), fisheye, WalkConfig(), {}).values
    assert np.abs(np.degrees(own[:2] - ours[:2])).max() < 0.05
    assert abs(math.expm1(own[2] - ours[2])) < 0.005
