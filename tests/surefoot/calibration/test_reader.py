"""Calibration files as people have them: the values, what is not taken, and the errors."""

import json
import math

import pytest

from models.geometry.intrinsics import Projection
from surefoot.calibration.reader import read_calibration_file
from surefoot.calibration.value import CalibrationFileError, Note
from tests.surefoot.calibration.samples import _OAKD, REJECTED, SAMPLES, TSAI, K


@pytest.mark.parametrize("name", SAMPLES)
def test_file_is_read_with_its_values_and_notes(name):
    sample = SAMPLES[name]
    found = read_calibration_file(sample.body, sample.camera)
    assert found.format == sample.format
    fx, skew, cx, _, fy, cy, *last = found.matrix
    assert (fx, fy, cx, cy) == pytest.approx(sample.focal)
    assert (skew, last) == (0.0, [0.0, 0.0, 1.0])
    if sample.distortion is not None:
        assert found.distortion == pytest.approx(sample.distortion, abs=2e-5)
    if sample.distortion is not None:
        expected = Projection.FISHEYE if sample.fisheye else Projection.PERSPECTIVE
        assert found.projection == expected
    assert found.size == sample.size
    assert tuple(found.notes) == sample.notes
    if name not in ("krtd", "tsai"):
        assert (found.rotation, found.translation_m) == (None, None)


@pytest.mark.parametrize("name", REJECTED)
def test_damaged_file_is_rejected_with_format_field_limit_and_value(name):
    body, reason = REJECTED[name]
    with pytest.raises(CalibrationFileError, match=f"^{reason}"):
        read_calibration_file(body)


def test_rotation_vector_and_translation_are_a_pose():
    """Pin: a camera that looks straight down from 5 m is turned by half a turn about x."""
    document = {"K": K, "image_size": [640, 480], "rvec": [3.141592653589793, 0, 0]}
    found = read_calibration_file(json.dumps({**document, "tvec": [0, 0, 5]}).encode())
    assert found.rotation == pytest.approx((1, 0, 0, 0, -1, 0, 0, 0, -1))
    assert found.pose.height_m == pytest.approx(5.0)
    assert found.lens.width == 640


def test_tsai_pose_is_in_metres():
    """Pin: view 001 of PETS 2009 is 7.066 m high, tilt 16.48, roll 3.09, heading 54.35 deg."""
    pose = read_calibration_file(TSAI).pose
    assert pose.height_m == pytest.approx(7.0656576, abs=1e-6)
    angles = [math.degrees(each) for each in (pose.tilt_rad, pose.roll_rad, pose.heading_rad)]
    assert angles == pytest.approx([16.482473, 3.087676, 54.349243], abs=1e-5)
    assert (pose.x_m, pose.y_m) == pytest.approx((-28.940182, -19.529053), abs=1e-5)


def test_image_size_is_required_for_a_lens():
    found = read_calibration_file(json.dumps({"K": K}).encode())
    with pytest.raises(CalibrationFileError, match="^width, height: are required"):
        _ = found.lens


def test_replaced_coefficients_agree_within_a_tenth_of_a_pixel():
    found = read_calibration_file(SAMPLES["eight coefficients"].body)
    note = found.notes[Note.FEWER_COEFFICIENTS]
    assert (note["given"], note["taken"]) == (8, 5)
    assert note["px"] < 0.1 < abs(_OAKD[0])
    assert found.distortion[:2] == pytest.approx((0.11402, -0.20418), abs=1e-4)
