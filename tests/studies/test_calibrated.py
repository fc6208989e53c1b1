import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.errors import ShapeError, TooFewTrajectoriesError
from models.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from models.regression.averaging import TrackPredictions
from studies.regressors.calibrated import (
    Calibration,
    calibrated_estimate,
    fit_calibration,
    mean_plane_parameters,
    sampling_covariance,
)

PRIOR = np.array([0.3, 0.02, np.log(6.0)])
SHRINKAGE = np.array([0.9, 0.5, 0.3])
BIAS = np.array([0.01, -0.02, 0.05])


def says(numbers: np.ndarray, count: int = 8) -> TrackPredictions:
    """Tracks that all say the same tilt, roll, log height."""
    q = quaternion_from_rotation(rotation_from_angles(numbers[0], numbers[1], 0.4))
    return TrackPredictions(
        height_m=np.full(count, np.exp(numbers[2])), quaternion_wxyz=np.tile(q, (count, 1))
    )


def poses(count: int = 300, seed: int = 0) -> np.ndarray:
    return PRIOR + np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * [0.26, 0.26, 0.4]


def calibration(true: np.ndarray, means: np.ndarray, sampling: float = 0.0) -> Calibration:
    return fit_calibration(PRIOR, true, means, np.tile(sampling**2 * np.eye(3), (len(true), 1, 1)))


def shrunk(numbers: np.ndarray) -> np.ndarray:
    return PRIOR + BIAS + SHRINKAGE * (numbers - PRIOR)


def test_a_known_shrinkage_is_undone():
    learned = calibration(poses(), shrunk(poses()))
    for true in poses(20, seed=1):
        estimate = calibrated_estimate(says(shrunk(true)), learned, seed=0)
        assert_allclose(estimate.values, true, atol=1e-6)
    assert estimate.tracks == 8


def test_a_bent_curve_with_cross_talk_is_undone():
    def bent(numbers: np.ndarray) -> np.ndarray:
        d = numbers - PRIOR
        return PRIOR + np.stack(
            [
                0.8 * d[:, 0] - d[:, 0] ** 3 + 0.1 * d[:, 2],
                0.5 * d[:, 1] + 0.3 * d[:, 0] * d[:, 1],
                0.4 * d[:, 2] + 0.5 * d[:, 0] + d[:, 1] ** 2,
            ],
            axis=-1,
        )

    learned = calibration(poses(), bent(poses()))
    for true in poses(20, seed=2):
        estimate = calibrated_estimate(says(bent(true[None])[0]), learned, seed=0)
        assert_allclose(estimate.values, true, atol=0.01)


def test_uncertainty_grows_by_what_the_curve_was_shrunk():
    rng = np.random.default_rng(3)
    true = poses(4000)
    learned = calibration(true, shrunk(true) + rng.normal(0, 0.02, true.shape))
    sd = np.sqrt(np.diag(calibrated_estimate(says(PRIOR + BIAS), learned, seed=0).covariance))
    # A tenth of the scatter stands for what is not known of it: sqrt(1.1).
    assert_allclose(sd, 0.02 / SHRINKAGE * np.sqrt(1.1), rtol=0.08)


def test_scatter_that_more_tracks_take_away_is_no_scatter_of_sites():
    rng = np.random.default_rng(4)
    true = poses(4000)
    means = shrunk(true) + rng.normal(0, 0.02, true.shape)
    few, none = calibration(true, means, sampling=0.02), calibration(true, means)
    assert (np.diag(few.site_covariance) < 0.25 * np.diag(none.site_covariance)).all()


def test_the_bootstrap_of_the_numbers_is_the_sd_of_their_mean():
    rng = np.random.default_rng(5)
    q = quaternion_from_rotation(
        rotation_from_angles(rng.normal(0.3, 0.05, 200), rng.normal(3.1, 0.1, 200), 0.4)
    )
    predictions = TrackPredictions(height_m=6 * np.exp(rng.normal(0, 0.05, 200)), quaternion_wxyz=q)
    sd = np.sqrt(np.diag(sampling_covariance(predictions, 0)))
    assert_allclose(sd, np.array([0.05, 0.1, 0.05]) / np.sqrt(200), rtol=0.25)
    assert mean_plane_parameters(predictions)[2] == pytest.approx(
        np.log(predictions.height_m.mean())
    )


def test_few_tracks_and_few_sets_are_refused():
    with pytest.raises(TooFewTrajectoriesError, match="at least 5 .* got 4"):
        calibrated_estimate(says(PRIOR, 4), calibration(poses(), poses()), seed=0)
    with pytest.raises(ShapeError, match="at least 26 .* got 25"):
        calibration(poses(25), poses(25))
    with pytest.raises(ShapeError, match=r"curve: \(13, 3\)"):
        Calibration(prior=PRIOR, curve=np.zeros((3, 3)), site_covariance=np.eye(3))
