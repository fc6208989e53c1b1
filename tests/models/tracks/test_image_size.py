"""Numbers of another image are doubted; people who walk in a corner of the frame are not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.reasons import TracksCode
from models.tracks import config
from models.tracks.image_size import doubt_image_size, fitting_sizes
from models.tracks.scaling import scaling_of_shares, scaling_of_size
from models.tracks.trajectory import Trajectory
from studies.recordings import load_recording
from tests.conftest import SCENES
from tests.models.sites import LENS, PRIOR, tracks_of

FRAME = (LENS.width, LENS.height)
FISHEYE = Intrinsics(
    width=1280, height=720, fx=420, fy=420, cx=639.5, cy=359.5,
    projection="fisheye", distortion=(0.05, -0.02, 0.01, -0.002),
)  # fmt: skip
# A narrow view far away: people walk about as evenly in a third of the frame.
MISSED = {"pets2009_s1l2_1_v001", "pets2009_s2l1_v001_sort"}
recorded = pytest.mark.skipif(not SCENES.is_dir(), reason="recorded scenes are not at hand")
NAMES = sorted(path.name for path in SCENES.iterdir() if path.is_dir()) if SCENES.is_dir() else []


@pytest.fixture(scope="module")
def people():
    return tracks_of(3, (PRIOR, 40))[0]


def posted(tracks, size, frame=FRAME):
    """Tracks in pixels of an image of another size."""
    scaling = scaling_of_size(frame, size)
    return [scaling.of_trajectory(track) for track in tracks]


def corner(tracks, size):
    """The parts of tracks within the upper left corner of the frame."""
    found = []
    for track in tracks:
        inside = ((track.uv > -0.5) & (track.uv < np.array(size) - 0.5)).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        parts = [track.part(np.arange(a, b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        found += [part for part in parts if part.long_enough]
    return found


def size_of(reason):
    return None if reason is None else (reason.values["width_px"], reason.values["height_px"])


def test_scaling_maps_the_edges_of_another_image_to_those_of_the_frame():
    edges = np.array([[-0.5, -0.5], [639.5, 359.5], [0.0, 0.0]])
    scaled = scaling_of_size((640, 360), (1920, 1080)).applied(edges)
    # The centre of the first pixel of three is the centre of the second one.
    np.testing.assert_allclose(scaled, [[-0.5, -0.5], [1919.5, 1079.5], [1.0, 1.0]])
    shares = scaling_of_shares((1920, 1080)).applied(np.array([[0.0, 0.0], [1.0, 0.5]]))
    np.testing.assert_allclose(shares, [[-0.5, -0.5], [1919.5, 539.5]])


@given(st.floats(1, 4000), st.floats(1, 4000), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_scaling_is_inverted(width, height, u, v):
    scaling = scaling_of_size((width, height), (1920, 1080))
    numbers = np.array([[u, v, v, u]])
    back = scaling.inverted(scaling.applied(numbers))
    np.testing.assert_allclose(back, numbers, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["perspective", "fisheye"])
@pytest.mark.parametrize("prior", [PRIOR, None], ids=["calibrated", "uncalibrated"])
def test_shares_are_doubted_at_any_lens(people, lens, prior):
    shares = [replace(t, uv=scaling_of_shares(FRAME).inverted(t.uv)) for t in people]
    reason = doubt_image_size(shares, lens, prior)
    assert reason.code == TracksCode.IMAGE_SHARES
    assert reason.values["tracks"] == 40
    assert 0 < reason.values["largest_px"] < 1.01
    assert doubt_image_size(shares[:1], lens, prior).code == TracksCode.IMAGE_SHARES
    assert doubt_image_size([*shares, people[0]], lens, prior) is None


@pytest.mark.parametrize("size", [(320, 180), (640, 360), (2560, 1440)])
def test_pixels_of_another_image_are_doubted(people, size):
    reason = doubt_image_size(posted(people, size), LENS, PRIOR)
    assert reason.code == TracksCode.OTHER_IMAGE_SIZE
    assert size_of(reason) == size
    assert reason.values["sizes_px"][0] == f"{size[0]}x{size[1]}"
    assert reason.values["rescaled_speed_mps"] == pytest.approx(1.3, abs=0.2)


def test_pixels_of_the_frame_are_not_doubted(people):
    assert doubt_image_size(people, LENS, PRIOR) is None
    assert doubt_image_size([], LENS, PRIOR) is None


def test_pixels_of_another_image_need_a_pose_and_enough_tracks(people):
    streamed = posted(people, (320, 180))
    assert doubt_image_size(streamed, LENS, None) is None
    assert doubt_image_size(streamed[: config.SIZE_FEWEST - 1], LENS, PRIOR) is None
    assert size_of(doubt_image_size(streamed[: config.SIZE_FEWEST], LENS, PRIOR)) == (320, 180)


@pytest.mark.parametrize("size", [(640, 360), (853, 480), (320, 180)])
def test_people_in_a_corner_of_the_frame_are_not_doubted(size):
    people = tracks_of(5, (PRIOR, 300))[0]
    inside = corner(people, size)[:80]
    assert doubt_image_size(inside, LENS, PRIOR) is None


def walks_along(line_m, count):
    """People who walk one line on the ground, back and forth, one after the other."""
    rng = np.random.default_rng(1)
    start, end = np.array(line_m)
    length = float(np.hypot(*(end - start)))
    tracks = []
    for number in range(count):
        along = np.arange(0, length, 0.4 * rng.normal(1.35, 0.15))[:, None] / length
        ground = start + (along if number % 2 else 1 - along) * (end - start)
        uv, _ = pixel_from_ground(LENS, PRIOR.rotation, PRIOR.centre_m, ground)
        uv += rng.normal(0, 1.0, uv.shape)
        kept = LENS.contains(uv)
        time_s = 20.0 * number + 0.4 * np.arange(len(uv))
        tracks.append(Trajectory(time_s=time_s[kept], uv=uv[kept]))
    return tracks


@pytest.mark.parametrize(
    "line_m", [((-6.0, 14.0), (6.0, 14.0)), ((-3.0, 9.0), (-6.0, 30.0))], ids=["across", "away"]
)
def test_one_path_is_not_doubted_in_the_frame(line_m):
    assert doubt_image_size(walks_along(line_m, 40), LENS, PRIOR) is None


def test_one_path_in_pixels_of_a_stream_is_doubted():
    away = walks_along(((-3.0, 9.0), (6.0, 30.0)), 40)
    reason = doubt_image_size(posted(away, (320, 180)), LENS, PRIOR)
    assert reason is not None
    assert "320x180" in reason.values["sizes_px"]


def test_fisheye_in_pixels_of_a_stream_is_doubted():
    rng = np.random.default_rng(2)
    prior = replace(PRIOR, tilt_rad=math.radians(45))
    tracks = []
    for number in range(40):
        start, way = rng.uniform((-8, 2), (8, 12)), rng.normal(0, 1, 2)
        ground = start + 0.54 * np.arange(20)[:, None] * way / np.hypot(*way)
        uv, valid = pixel_from_ground(FISHEYE, prior.rotation, prior.centre_m, ground)
        kept = valid & FISHEYE.contains(np.nan_to_num(uv, nan=-1e6))
        time_s = 20.0 * number + 0.4 * np.arange(20)
        tracks.append(Trajectory(time_s=time_s[kept], uv=uv[kept]))
    tracks = [track for track in tracks if track.long_enough]
    assert len(tracks) >= config.SIZE_FEWEST
    assert ground_from_pixel(FISHEYE, prior.rotation, prior.centre_m, tracks[0].uv)[1].all()
    assert doubt_image_size(tracks, FISHEYE, prior) is None
    reason = doubt_image_size(posted(tracks, (320, 180)), FISHEYE, prior)
    assert size_of(reason) == (320, 180)


def test_fitting_sizes_contain_the_points_and_are_reached():
    corners = np.array([[1.0, 2.0], [630.0, 352.0]] * 50)
    fits = fitting_sizes(corners, (1920, 1080))
    assert (640, 360) in fits
    assert (416, 234) not in fits  # people are outside
    assert (1280, 720) not in fits  # nobody reaches its edges
    assert (1920, 1080) not in fitting_sizes(3 * corners, (1920, 1080))


@recorded
@pytest.mark.parametrize("name", NAMES)
def test_recordings_are_not_doubted_whole_or_cropped(name):
    (scene,) = load_recording(SCENES / name)
    lens, frame = scene.intrinsics, (scene.intrinsics.width, scene.intrinsics.height)
    tracks = [each.trajectory for each in scene.tracks if each.trajectory.long_enough]
    for count in (30, 100, 200):
        assert doubt_image_size(tracks[:count], lens, scene.true_pose) is None
    for part in (3, 2):
        inside = corner(tracks, (frame[0] // part, frame[1] // part))
        assert doubt_image_size(inside[:200], lens, scene.true_pose) is None


@recorded
@pytest.mark.parametrize("name", NAMES)
def test_recordings_in_a_third_of_their_size_are_doubted_but_for_known_ones(name):
    (scene,) = load_recording(SCENES / name)
    lens = scene.intrinsics
    frame, third = (lens.width, lens.height), (lens.width // 3, lens.height // 3)
    tracks = [each.trajectory for each in scene.tracks if each.trajectory.long_enough][:200]
    reason = doubt_image_size(posted(tracks, third, frame), lens, scene.true_pose)
    assert (reason is None) == (name in MISSED)
    if reason is not None:
        assert f"{third[0]}x{third[1]}" in reason.values["sizes_px"]
