import math

import numpy as np
import pytest

from models.errors import TooFewTrajectoriesError
from models.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from models.regression.averaging import TrackPredictions, average_windows, averaged_estimate


def quaternions(tilts, rolls=0.0, heading=0.0):
    return quaternion_from_rotation(rotation_from_angles(tilts, rolls, heading))


def test_the_estimate_is_the_mean():
    tilts = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    predictions = TrackPredictions(
        height_m=np.array([4.0, 5.0, 6.0, 7.0, 8.0]), quaternion_wxyz=quaternions(tilts)
    )
    estimate = averaged_estimate(predictions, seed=0)
    assert estimate.value.height_m == pytest.approx(6.0)
    assert estimate.value.tilt_rad == pytest.approx(0.3)
    assert estimate.value.roll_rad == pytest.approx(0.0, abs=1e-12)
    assert estimate.tracks == 5


def test_signs_of_quaternions_do_not_matter():
    q = quaternions(np.linspace(0.1, 0.5, 6), 0.1, 3.0)
    flipped = q * np.array([1, -1, 1, -1, 1, -1])[:, None]
    heights = np.full(6, 5.0)
    first = averaged_estimate(TrackPredictions(height_m=heights, quaternion_wxyz=q), 0)
    again = averaged_estimate(TrackPredictions(height_m=heights, quaternion_wxyz=flipped), 0)
    assert again.value.tilt_rad == pytest.approx(first.value.tilt_rad)
    assert again.sd.tilt_rad == pytest.approx(first.sd.tilt_rad)


def test_the_bootstrap_finds_the_sd_of_the_mean():
    rng = np.random.default_rng(0)
    count = 200
    predictions = TrackPredictions(
        height_m=rng.normal(6, 1.0, count),
        quaternion_wxyz=quaternions(rng.normal(0.3, 0.05, count), rng.normal(0, 0.1, count)),
    )
    estimate = averaged_estimate(predictions, seed=1)
    assert estimate.sd.height_m == pytest.approx(1.0 / math.sqrt(count), rel=0.15)
    assert estimate.sd.tilt_rad == pytest.approx(0.05 / math.sqrt(count), rel=0.15)
    assert estimate.sd.roll_rad == pytest.approx(0.1 / math.sqrt(count), rel=0.15)
    assert averaged_estimate(predictions, seed=1) == estimate
    assert averaged_estimate(predictions, seed=2) != estimate


def test_tracks_that_agree_have_no_spread():
    predictions = TrackPredictions(height_m=np.full(9, 5.0), quaternion_wxyz=quaternions([0.2] * 9))
    estimate = averaged_estimate(predictions, seed=0)
    assert estimate.sd.height_m == 0
    assert estimate.sd.tilt_rad == pytest.approx(0, abs=1e-9)


def test_too_few_tracks_are_counted():
    predictions = TrackPredictions(height_m=np.full(4, 5.0), quaternion_wxyz=quaternions([0.2] * 4))
    with pytest.raises(TooFewTrajectoriesError, match="at least 5 .* got 4"):
        averaged_estimate(predictions, seed=0)


def test_each_person_counts_once_however_many_windows():
    owners, predictions = average_windows(
        np.array([4.0, 6.0, 9.0]), quaternions([0.1, 0.3, 0.5]), np.array([2, 2, 7])
    )
    assert owners.tolist() == [2, 7]
    assert predictions.height_m.tolist() == [5.0, 9.0]
    np.testing.assert_allclose(predictions.quaternion_wxyz, quaternions([0.2, 0.5]), atol=1e-12)
