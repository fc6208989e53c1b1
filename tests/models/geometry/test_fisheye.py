"""Fisheye lenses: by hand, by OpenCV, and where they end."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.geometry.footprint import view_outline
from models.geometry.intrinsics import Intrinsics
from models.geometry.lens_forms import lens_of
from models.geometry.pose import CameraPose
from tests.strategies import numbers

EQUIDISTANT = Intrinsics(
    width=1280, height=960, fx=400, fy=410, cx=630, cy=470, projection="fisheye"
)
LENS = replace(EQUIDISTANT, distortion=(0.08, -0.03, 0.01, -0.002))
FOLDED = replace(EQUIDISTANT, distortion=(-0.3, 0.0, 0.0, 0.0))  # at sqrt(1 / 0.9) = 60.4 deg


def ray(angle: float, around: float) -> np.ndarray:
    far = math.tan(angle)
    return np.array([far * math.cos(around), far * math.sin(around), 1.0])


def test_an_equidistant_lens_puts_an_angle_at_its_radius() -> None:
    # A quarter of pi to the right and an eighth down.
    uv, valid = EQUIDISTANT.project(np.array([[1.0, 0, 1], [0, math.tan(math.pi / 8), 1]]))
    assert valid.all()
    assert_allclose(uv, [[630 + 100 * math.pi, 470], [630, 470 + 51.25 * math.pi]])


def test_every_coefficient_counts() -> None:
    # theta = 0.5: 0.5 + 0.08 / 8 - 0.03 / 32 + 0.01 / 128 - 0.002 / 512
    uv, _ = LENS.project(ray(0.5, 0.0))
    assert_allclose(uv, [630 + 400 * 0.509136719, 470], atol=1e-6)


@given(st.lists(st.tuples(numbers(0, 1.53), numbers(0, 6.3)), min_size=1, max_size=9))
def test_what_is_projected_comes_back(polar: list[tuple[float, float]]) -> None:
    rays = np.array([ray(*each) for each in polar])
    uv, seen = LENS.project(3.7 * rays)
    back, reached = LENS.rays(uv)
    assert seen.all()
    assert reached.all()
    assert_allclose(back, rays, rtol=1e-9, atol=1e-9)


def test_projection_and_rays_are_those_of_opencv() -> None:
    rng = np.random.default_rng(4)
    rays = np.array([ray(*each) for each in rng.uniform(0, [1.3, 6.3], (300, 2))])
    points = rays * rng.uniform(0.5, 50, (300, 1))
    uv, _ = LENS.project(points)
    coefficients = np.array(LENS.distortion)
    zero = np.zeros(3)
    expected, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, LENS.matrix, coefficients)
    assert_allclose(uv, expected[:, 0], atol=1e-8)
    # OpenCV itself ends where the image radius is pi / 2.
    straight = cv2.fisheye.undistortPoints(uv[:, None], LENS.matrix, coefficients)
    found, valid = LENS.rays(uv)
    assert valid.all()
    assert_allclose(found[:, :2], straight[:, 0], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("lens", [EQUIDISTANT, LENS, FOLDED])
def test_the_lens_ends_at_88_degrees_or_where_it_folds(lens: Intrinsics) -> None:
    edge = math.atan(lens.max_radius)
    assert math.degrees(edge) == pytest.approx(60.395 if lens is FOLDED else 88.0, abs=0.01)
    _, valid = lens.project(np.array([ray(edge - 1e-3, 1.0), ray(edge + 1e-3, 1.0)]))
    assert valid.tolist() == [True, False]
    # From the middle outwards: known up to somewhere, and nowhere beyond.
    line = np.column_stack([np.linspace(630, 1500, 400), np.full(400, 470.0)])
    rays, reached = lens.rays(line)
    assert (np.diff(reached.astype(int)) <= 0).all()
    assert 0 < reached.sum() < 400
    assert (lens.beyond(line) == ~reached).all()
    assert np.isnan(rays[~reached]).all()
    assert (np.diff(rays[reached, 0]) > 0).all()
    assert lens.rays(lens.pulled_in(line))[1].all()
    assert_allclose(lens.pulled_in(line[:100]), line[:100])


@pytest.mark.parametrize(
    "distortion", [(0.171, -0.272, 0.258, -0.081), (0.372, -0.130, 0.566, -0.275)]
)
def test_a_lens_that_almost_folds_is_known_as_far_as_it_reaches(
    distortion: tuple[float, ...],
) -> None:
    """Newton's method from the radius itself did not come to 7 and to 49 % of its pixels."""
    lens = replace(EQUIDISTANT, fx=400, fy=400, distortion=distortion)
    angles = np.linspace(0.0, 0.999 * math.atan(lens.max_radius), 500)
    image = angles * (1 + sum(k * angles ** (2 * n) for n, k in enumerate(distortion, start=1)))
    rays, valid = lens.rays(np.column_stack([630 + 400 * image, np.full(500, 470.0)]))
    assert valid.all()
    assert_allclose(np.arctan2(rays[:, 0], rays[:, 2]), angles, atol=1e-6)


def test_what_is_behind_or_no_number_is_not_valid() -> None:
    _, valid = LENS.project(np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0], [0.0, 0.0, 1.0]]))
    assert valid.tolist() == [False, False, True]
    rays, valid = LENS.rays(np.array([[math.nan, 1.0], [630.0, 470.0], [640.0, 480.0]]))
    assert valid.tolist() == [False, True, True]
    assert_allclose(rays[1], [0, 0, 1])


def test_a_perspective_lens_has_a_picture_of_all_its_pixels() -> None:
    lens = Intrinsics(width=1280, height=960, fx=400, fy=410, cx=630, cy=470)
    assert not lens.beyond(np.array([[-5000.0, 0.0]])).any()
    assert_allclose(lens.pulled_in(np.array([[-5000.0, 0.0]])), [[-5000.0, 0.0]], atol=1e-9)
    seen = lens.pinhole
    assert_allclose([seen.fx, seen.fy, seen.cx, seen.cy], [400, 410, 630, 470])


def test_its_pinhole_ends_where_the_picture_does() -> None:
    narrow = replace(LENS, fx=900, fy=900)
    edges = np.array([[-0.5, 470.0], [1279.5, 470.0], [630.0, -0.5], [630.0, 959.5]])
    rays, _ = narrow.rays(edges)
    u, v = narrow.pinhole.project(rays)[0].T
    assert_allclose([u[0], u[1], v[2], v[3]], [-0.5, 1279.5, -0.5, 959.5])
    assert LENS.pinhole.fx > 0  # its corners are beyond what it sees


def test_the_ground_in_its_picture_reaches_around() -> None:
    pose = CameraPose(height_m=5.0, tilt_rad=math.radians(60), roll_rad=0.0)
    outline = view_outline(LENS, pose, 50.0)
    assert len(outline) == 100
    assert np.isfinite(outline).all()
    wide = np.linalg.norm(outline, axis=1)
    assert wide.max() == pytest.approx(50.0)
    assert outline[:, 1].min() < 0  # and behind the camera's foot


def test_lenses_by_their_forms() -> None:
    size = {"width": 1280, "height": 960}
    lens = lens_of(**size, fisheye={"fx": 400.0})
    assert (lens.fy, lens.cx, lens.cy, lens.distortion) == (400.0, 639.5, 479.5, (0.0,) * 4)
    assert lens.hfov_rad == pytest.approx(3.2)
    for wrong in (
        {},
        {"hfov_deg": 90.0, "fisheye": {"fx": 1.0}},
        {"fisheye": {"fx": 400.0, "distortion": [0.1]}},
        {"fisheye": {}},
    ):
        with pytest.raises((ShapeError, TypeError)):
            lens_of(**size, **wrong)
    with pytest.raises(ShapeError, match="projection"):
        Intrinsics(**size, fx=1, fy=1, cx=1, cy=1, projection="orthographic")
    with pytest.raises(ShapeError, match="4 numbers are needed, got 5"):
        replace(EQUIDISTANT, distortion=(0.0,) * 5)
