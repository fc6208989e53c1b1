from dataclasses import replace
from math import inf, nan

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from tests.strategies import intrinsics, numbers, seen_points

PLAIN = Intrinsics(width=1280, height=720, fx=1000, fy=800, cx=600, cy=300)
LENS = replace(PLAIN, distortion=(0.1, 0.01, 0.002, -0.003, 0.001))
BARREL = replace(PLAIN, distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
TOWN_CENTRE = Intrinsics(
    width=1920,
    height=1080,
    fx=2696.35888671875,
    fy=2696.35888671875,
    cx=959.5,
    cy=539.5,
    distortion=(-0.60150605, 4.70203733, -0.00047452, -0.0078229, 0.0),
)
CLOSELY = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14)


def lens_of(*distortion: float) -> Intrinsics:
    return replace(PLAIN, distortion=distortion)


def ray(radius: float, angle: float = 0.6) -> np.ndarray:
    return np.array([radius * np.cos(angle), radius * np.sin(angle), 1.0])


# Pins


def test_projection_without_distortion() -> None:
    # u = 600 + 1000 * 1/4, v = 300 - 800 * 0.5/4
    uv, valid = PLAIN.project(np.array([1.0, -0.5, 4.0]))
    assert valid
    assert_allclose(uv, [850, 200])


def test_projection_with_every_coefficient() -> None:
    # x, y = 0.5, 0.25; r2 = 0.3125; radial = 1 + 0.03125 + 0.0009765625 + 0.0000305176
    # x' = 0.5 radial + 2 p1 xy + p2 (r2 + 2 x2) = 0.51612854 + 0.0005 - 0.0024375
    # y' = 0.25 radial + p1 (r2 + 2 y2) + 2 p2 xy = 0.25806427 + 0.000875 - 0.00075
    uv, valid = LENS.project(np.array([1.0, 0.5, 2.0]))
    assert valid
    assert_allclose(uv, [600 + 1000 * 0.51419104, 300 + 800 * 0.25818927], atol=1e-5)


def test_ray_of_a_pixel_without_distortion() -> None:
    rays, valid = PLAIN.rays(np.array([850.0, 200.0]))
    assert valid
    assert_allclose(rays, [0.25, -0.125, 1])


def test_matrix_holds_the_four_numbers() -> None:
    assert_allclose(PLAIN.matrix, [[1000, 0, 600], [0, 800, 300], [0, 0, 1]])


@pytest.mark.parametrize(
    ("distortion", "expected"),
    [
        ((0, 0, 0, 0, 0), inf),
        ((0.2, 0.1, 0, 0, 0), inf),
        ((-0.3, 0, 0, 0, 0), 1.0540926),  # 1 - 0.9 s = 0
        ((0, -0.2, 0, 0, 0), 1.0),  # 1 - s^2 = 0
        ((0, 0, 0, 0, -1 / 7), 1.0),  # 1 - s^3 = 0
        ((-0.6015, 4.702, 0, 0, 0), inf),  # dips, yet never turns back
        ((0.1, 0, 0.05, -0.05, 0), inf),  # tangential terms do not count
    ],
)
def test_max_radius_is_where_the_radial_polynomial_turns_back(
    distortion: tuple[float, ...], expected: float
) -> None:
    assert lens_of(*distortion).max_radius == pytest.approx(expected, abs=1e-6)


# Round trips


@given(seen_points())
def test_pixel_round_trip(seen: tuple[Intrinsics, np.ndarray]) -> None:
    lens, uv = seen
    rays, reached = lens.rays(uv)
    back, valid = lens.project(3.7 * rays)
    assert_allclose(back[reached], uv[reached], atol=1e-6)
    assert (valid == reached).all()


@given(intrinsics(), st.lists(st.tuples(numbers(0, 0.9), numbers(0, 6.3)), min_size=1, max_size=9))
def test_ray_round_trip_up_to_the_fold(lens: Intrinsics, polar: list[tuple[float, float]]) -> None:
    rays = np.array([ray(share * min(lens.max_radius, 1.0), angle) for share, angle in polar])
    uv, seen = lens.project(rays)
    back, reached = lens.rays(uv)
    assert seen.all()
    assert reached.all()
    assert_allclose(back, rays, atol=1e-7)


def test_every_pixel_of_a_strongly_distorted_picture_has_a_ray() -> None:
    u, v = np.meshgrid(np.linspace(-0.5, 1919.5, 40), np.linspace(-0.5, 1079.5, 30))
    uv = np.stack([u, v], -1)
    rays, valid = TOWN_CENTRE.rays(uv)
    assert valid.all()
    assert_allclose(TOWN_CENTRE.project(rays)[0], uv, atol=1e-6)


@pytest.mark.parametrize(
    ("distortion", "radius"),
    [
        ((0.10819, 0.48485, 0, 0, -0.29994), 0.99299),  # folds at 1.215, distorted radius 1.281
        ((0.66998, -0.23637, 0, 0, -0.17445), 0.89335),
        ((0.67409, 0.5565, 0, 0, 0.38849), 1.33079),  # never folds
    ],
)
def test_a_pincushion_lens_finds_the_ray_of_what_it_projected(
    distortion: tuple[float, ...], radius: float
) -> None:
    lens = lens_of(*distortion)
    uv, seen = lens.project(ray(radius))
    assert seen
    back, reached = lens.rays(uv)
    assert reached
    assert_allclose(back, ray(radius), atol=1e-7)


# Oracles


@given(intrinsics(), st.integers(0, 10_000))
def test_projection_is_that_of_opencv(lens: Intrinsics, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.array([ray(r, a) for r, a in rng.uniform(0, [0.9, 6.3], (20, 2))])
    points *= rng.uniform(0.5, 50, (20, 1))
    uv, valid = lens.project(points)
    zero = np.zeros(3)
    expected, _ = cv2.projectPoints(points, zero, zero, lens.matrix, np.array(lens.distortion))
    assert_allclose(uv[valid], expected[:, 0][valid], atol=1e-8)


@pytest.mark.parametrize("lens", [LENS, BARREL, TOWN_CENTRE])
def test_rays_are_those_of_opencv(lens: Intrinsics) -> None:
    rng = np.random.default_rng(8)
    # Within a distorted radius of 0.55, which all three lenses reach.
    uv = rng.uniform(-0.38, 0.38, (200, 2)) * (lens.fx, lens.fy) + (lens.cx, lens.cy)
    rays, valid = lens.rays(uv)
    expected = cv2.undistortPoints(
        uv[:, None], lens.matrix, np.array(lens.distortion), criteria=CLOSELY
    )
    assert valid.all()
    assert_allclose(rays[:, :2], expected[:, 0], atol=1e-7)


# Degenerate cases


def test_points_behind_the_camera_are_not_valid() -> None:
    uv, valid = LENS.project(np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0], [0.1, 0.1, 1.0]]))
    assert valid.tolist() == [False, False, True]
    assert np.isnan(uv[:2]).all()
    assert np.isfinite(uv[2]).all()


def test_points_that_the_distortion_folds_back_are_not_valid() -> None:
    # 1.5 (1 - 0.3 * 2.25) = 0.4875: the polynomial alone would put it well inside the image.
    uv, valid = BARREL.project(np.array([[1.5, 0.0, 1.0], [1.06, 0, 1], [1.05, 0, 1]]))
    assert valid.tolist() == [False, False, True]
    assert np.isnan(uv[:2]).all()


def test_pixels_that_no_ray_reaches_are_not_valid() -> None:
    # The largest distorted radius is 1.0540926 * (1 - 1/3) = 0.7027.
    rays, valid = BARREL.rays(np.array([[600 + 750.0, 300.0], [600 + 700.0, 300.0]]))
    assert valid.tolist() == [False, True]
    assert np.isnan(rays[0]).all()
    assert rays[1, 0] < BARREL.max_radius


def test_one_bad_pixel_does_not_spoil_the_others() -> None:
    uv = np.array([[nan, nan], [5000.0, -4000.0], [700.0, 350.0]])
    rays, valid = BARREL.rays(uv)
    assert valid.tolist() == [False, False, True]
    alone, _ = BARREL.rays(uv[2])
    assert_allclose(rays[2], alone, atol=1e-12)


def test_no_pixel_at_all_gives_no_ray() -> None:
    rays, valid = LENS.rays(np.empty((0, 2)))
    assert rays.shape == (0, 3)
    assert valid.shape == (0,)


def test_contains_widens_by_the_margin_and_refuses_nan() -> None:
    uv = np.array([[-3.0, 10], [10, 722], [nan, 10]])
    assert PLAIN.contains(uv).tolist() == [False, False, False]
    assert PLAIN.contains(uv, margin_px=3).tolist() == [True, True, False]
    assert PLAIN.contains(uv, margin_px=2).tolist() == [False, False, False]


@pytest.mark.parametrize("field", ["width", "height", "fx", "fy"])
@pytest.mark.parametrize("value", [0, -1, nan, inf])
def test_sizes_and_focal_lengths_must_be_above_zero(field: str, value: float) -> None:
    with pytest.raises(ShapeError, match=field):
        replace(PLAIN, **{field: value})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cx": nan}, "cx"),
        ({"cy": inf}, "cy"),
        ({"distortion": (0, 0, 0, 0, nan)}, "distortion"),
        ({"distortion": (0.1, 0.1, 0.0, 0.0)}, "5 numbers are needed, got 4"),
    ],
)
def test_numbers_that_make_no_lens_are_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(ShapeError, match=says):
        replace(PLAIN, **change)


@pytest.mark.parametrize("tiny", [1e-320, -1e-320, 1e-310, 1e-30])
def test_a_coefficient_that_moves_no_pixel_counts_as_none(tiny: float) -> None:
    # Dividing by it overflows.
    assert lens_of(-0.3, 0, 0, 0, tiny).max_radius == pytest.approx(1.0540926, abs=1e-6)
    assert lens_of(0.1, tiny, 0, 0, 0).max_radius == inf
