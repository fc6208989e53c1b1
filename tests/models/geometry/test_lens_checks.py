"""Impossible lenses are rejected, likely mistakes are found, and published lenses pass."""

import json
import math

import pytest

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.lens_checks import LensDoubt, check_lens, fold_px, lens_questions
from tests.conftest import SCENES

FULL_HD = {"width": 1920, "height": 1080, "fx": 1500.0, "fy": 1500.0, "cx": 959.5, "cy": 539.5}
FOLDS_AT_BOARD = (-0.25303888, 0.08350975, 3.777e-05, 2.2046e-04, -0.01365072)


def lens(**changes):
    return Intrinsics(**FULL_HD | changes)


def published(width, height, fx, fy, cx, cy, *distortion, projection="perspective"):
    return Intrinsics(
        width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy, distortion=distortion,
        projection=projection,
    )  # fmt: skip


# Calibrations of common cameras as their owners publish them.
PUBLISHED = {
    "EuRoC cam0": published(
        752, 480, 458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 1.936e-4, 1.762e-5, 0
    ),
    "TUM fr1": published(
        640, 480, 517.3064, 516.4692, 318.643, 255.314, 0.262383, -0.953104, -0.005358, 0.002628,
        1.163314
    ),
    "webcam of 97 deg": published(1280, 720, 561.605, 562.915, 641.382, 341.563, *FOLDS_AT_BOARD),
    "GoPro": published(
        1920, 1080, 857.48, 876.72, 968.06, 556.37, -0.2569, 0.0877, -0.0004, 0.0015, -0.0164
    ),
    "Kodak SP360": published(
        1440, 1440, 559.777, 537.9, 654.689, 757.538, -0.1710343, 0.0156234, -0.0068421, 0.0058809,
        0
    ),
    "RDK F37": published(
        1920, 1080, 1726.5976, 1737.3596, 904.9797, 529.1234, 0.169978, -0.697303, -0.002944,
        -0.004961, 0
    ),
    "phone": published(
        1920, 1080, 1484.12, 1483.297, 982.187, 543.057, 0.0937095, -0.1640722, 0, 0, 0.1224193
    ),
    "Waymo side, cropped": published(1920, 886, 2059.0, 2059.0, 935.0, 233.0, 0, 0, 0, 0, 0),
    "Kalibr fisheye": published(
        752, 480, 461.487, 460.111, 356.391, 231.157, -0.001651, 0.024372, -0.035828, 0.019861,
        projection="fisheye",
    ),
    "surround view fisheye": published(
        1280, 720, 311.532, 310.685, 643.671, 344.967, 0.064949, 0.001925, -0.012889, 0.00206,
        projection="fisheye",
    ),
    "hallway fisheye": published(
        1920, 1080, 1004.4, 1005.4, 959.5, 539.5, 0.054, 0.032, -0.031, 0.016, projection="fisheye"
    ),
}  # fmt: skip


def recorded():
    """The lens of each recording that the tests are given."""
    for path in sorted(SCENES.parent.glob("*/*/*.json")):
        if path.parts[-3] in ("scenes", "long", "together"):
            found = [json.loads(path.read_text())]
            while found:
                part = found.pop()
                if isinstance(part, dict) and isinstance(part.get("intrinsics"), dict):
                    yield f"{path.parent.name}/{path.stem}", Intrinsics(**part["intrinsics"])
                if isinstance(part, dict):
                    found += part.values()


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_lens_passes_without_question(name):
    assert lens_questions(check_lens(PUBLISHED[name])) == []


def test_recorded_lenses_pass_without_question():
    seen = list(recorded())
    assert len(seen) >= 7 or not SCENES.exists()
    assert [name for name, each in seen if lens_questions(check_lens(each))] == []


@pytest.mark.parametrize("hfov_deg", [3, 30, 60, 90, 120, 145])
@pytest.mark.parametrize("size", [(640, 480), (704, 576), (1920, 1080), (2592, 1944), (1080, 1920)])
def test_pinhole_of_any_stream_passes_without_question(hfov_deg, size):
    width, height = size
    pinhole = Intrinsics.of_view(width=width, height=height, hfov_rad=math.radians(hfov_deg))
    assert lens_questions(check_lens(pinhole)) == []


def test_fold_is_where_the_image_radius_stops_growing():
    """Pin: r - 2 r^3 is largest at r = 1 / sqrt 6, where it is 2 / (3 sqrt 6) = 0.27217."""
    assert fold_px(lens(distortion=(-2.0, 0, 0, 0, 0))) == pytest.approx(1500 * 0.27216553)
    assert fold_px(lens(distortion=(-0.2, 0.1, 0, 0, 0))) == math.inf
    assert fold_px(lens(distortion=(0.1, 0, 0, 0), projection="fisheye")) == math.inf
    # theta - 0.5 theta^3 is largest at theta = sqrt(2 / 3), where it is 0.54433.
    folded = lens(distortion=(-0.5, 0, 0, 0), projection="fisheye")
    assert fold_px(folded) == pytest.approx(1500 * 0.54433105)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"distortion": (-2.0, 0, 0, 0, 0)},
         r"^distortion: must not fold back within 540 px .* \(got a fold at 408 px"),
        ({"distortion": (-2.0, 0, 0, 0), "projection": "fisheye", "fx": 600.0, "fy": 600.0},
         r"^distortion: must not fold back within 270 px .* \(got a fold at 163 px"),
        ({"width": 960, "height": 540, "cx": 960.0, "cy": 540.0},
         r"^cx: must be within the image, -0.5 to 959.5 px \(got 960\); the lens appears to be of "
         r"an image of 1920 x 1080$"),
        ({"cx": -1.0}, r"^cx: must be within the image, -0.5 to 1919.5 px \(got -1\)$"),
        ({"cy": 1080.0}, r"^cy: must be within the image, -0.5 to 1079.5 px \(got 1080\)$"),
        ({"fy": 290.0}, r"^fy: must be from 300 to 7500 px, .* of fx \(got 290\)$"),
    ],
)  # fmt: skip
def test_impossible_lens_is_rejected_with_limit_and_value(changes, reason):
    with pytest.raises(ShapeError, match=reason):
        check_lens(lens(**changes))


@pytest.mark.parametrize(
    ("changes", "doubt", "field"),
    [
        ({"cx": 0.0, "cy": 0.0}, LensDoubt.CORNER, "cx"),
        ({"width": 1280, "height": 720}, LensDoubt.OTHER_SIZE, "cx"),
        ({"width": 3840, "height": 2160}, LensDoubt.OTHER_SIZE, "cx"),
        ({"width": 1080, "height": 1920}, LensDoubt.SWAPPED, "width"),
        ({"cx": 539.5, "cy": 959.5}, LensDoubt.SWAPPED, "width"),
        ({"cx": 320.0, "cy": 240.0}, LensDoubt.OFF_CENTRE, "cx"),
        ({"cy": 900.0}, LensDoubt.OFF_CENTRE, "cy"),
        ({"fy": 750.0}, LensDoubt.ASPECT, "fy"),
        ({"fx": 950.0, "fy": 950.0, "distortion": FOLDS_AT_BOARD}, None, None),
        ({"fx": 600.0, "fy": 600.0, "distortion": (-0.3, 0.1, 0, 0, -0.013)}, LensDoubt.FOLDS,
         "distortion"),
        ({"distortion": (-0.28, 0.025, 0.163, 0.001, 0.0)}, LensDoubt.TANGENTIAL, "distortion"),
    ],
)  # fmt: skip
def test_likely_mistake_is_found(changes, doubt, field):
    found = lens_questions(check_lens(lens(**changes)))
    expected = [] if doubt is None else [(doubt, field)]
    assert [(each.doubt, each.field) for each in found] == expected


def test_other_size_is_named():
    (asked,) = lens_questions(lens(width=1280, height=720))
    assert (asked.values["width"], asked.values["height"]) == (1920, 1080)
