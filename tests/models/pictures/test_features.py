import gzip
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from models.errors import CheckpointError, ShapeError
from models.pictures import config
from models.pictures.features import Features, describe
from tests.models.pictures.given import wall


def test_features_come_back_from_bytes_as_they_were():
    found = describe(wall())
    again = Features.from_bytes(found.to_bytes())
    assert_array_equal(again.points_px, found.points_px)
    assert_array_equal(again.descriptors, found.descriptors)
    assert_array_equal(again.measures.edges, found.measures.edges)
    assert_array_equal(again.known.covariance, np.zeros((4, 4)))
    assert again.measures.digest == found.measures.digest
    assert again.to_bytes() == found.to_bytes()


def test_bytes_that_are_none_are_refused():
    data = describe(wall()).to_bytes()
    for nonsense in (b"", b"picture", data[: len(data) // 2], data[:-9] + bytes(9)):
        with pytest.raises(CheckpointError):
            Features.from_bytes(nonsense)
    bomb = gzip.compress(bytes(config.MOST_STORED_BYTES + 2))
    with pytest.raises(CheckpointError, match="when unpacked"):
        Features.from_bytes(bomb)


def test_arrays_that_do_not_fit_are_refused():
    found = describe(wall())
    for wrong in (
        {"points_px": found.points_px[:-1]},
        {"points_px": found.points_px * np.float32(np.nan)},
        {"descriptors": found.descriptors.astype(float)},
        {"width": 0},
        {"analysed": 2.0},
    ):
        with pytest.raises(ShapeError):
            replace(found, **wrong)


def test_people_are_left_out():
    box = np.array([[200.0, 100.0, 300.0, 260.0]])
    points = describe(wall(), boxes=box).points_px
    x, y = points.T
    assert len(points) > 100
    assert not ((x > 201) & (x < 299) & (y > 101) & (y < 259)).any()


def test_a_large_picture_is_looked_at_small_and_its_places_are_its_own():
    small = wall()
    large = np.kron(small, np.ones((4, 4), np.uint8))  # each pixel is four by four
    found = describe(large)
    assert (found.width, found.height, found.analysed) == (2560, 1440, 0.375)
    assert found.points_px[:, 0].max() > 2000
    assert len(found.points_px) <= config.MAX_FEATURES + 1


def test_what_is_no_picture_in_grey_is_refused():
    for wrong in (
        np.zeros((360, 640, 3), np.uint8),
        np.zeros((360, 640)),
        np.zeros((10, 640), np.uint8),
    ):
        with pytest.raises(ShapeError):
            describe(wrong)
    with pytest.raises(ShapeError, match="boxes"):
        describe(wall(), boxes=np.zeros((2, 3)))
