"""What noise in directions fakes: sums by hand, and the covariance against its definition."""

import numpy as np
from numpy.testing import assert_allclose

from models.tracks.observations import Rows
from models.walking.direction_noise import corrected_covariance, noise_information
from models.walking.measures import Measured
from models.walking.mixed.model import VarianceComponents, Weights

COMPONENTS = VarianceComponents(
    between_sd=0.2,
    trend_sd=0.1,
    within_sd=0.1,
    correlation=0.0,
    outlier_share=0.1,
    outlier_mean=-2.0,
    outlier_sd=0.8,
)
MATRIX = np.array([[9.0, 2.0, 1.0], [2.0, 6.0, -1.0], [1.0, -1.0, 4.0]])


def measured_of(lengths, d_direction_noise, valid=None):
    count = sum(lengths)
    rows = Rows(
        owner_idx=np.repeat(np.arange(len(lengths)), lengths),
        linked=np.zeros(count, dtype=bool),
        time_s=np.arange(count, dtype=float),
        when=np.zeros(count),
        owners=len(lengths),
    )
    return Measured(
        value=np.zeros(count),
        place=np.zeros((count, 2)),
        direction=None,
        valid=np.ones(count, dtype=bool) if valid is None else np.array(valid),
        d_value=np.ones((count, 3)),
        d_place=np.zeros((count, 2, 3)),
        d_direction=None,
        d_direction_noise=np.array(d_direction_noise, dtype=float),
        rows=rows,
    )


def weights_of(measured, row=1.0):
    rows = measured.rows
    return Weights(
        row=np.full(len(rows), row),
        track=np.ones(rows.owners),
        inlier=np.ones(len(rows)),
        effects=np.zeros((rows.owners, 2)),
        effect_covariance=np.zeros((rows.owners, 2, 2)),
    )


def test_a_tracks_own_level_and_trend_take_two_of_its_rows():
    measured = measured_of([4], [[0.1, -0.2, 0.0]] * 4)
    # 4 rows of which 2 are left, of weight 1 / 0.1^2: 4 * (2 / 4) * 100 = 200.
    expected = 200 * np.array([[0.01, -0.02, 0.0], [-0.02, 0.04, 0.0], [0.0, 0.0, 0.0]])
    assert_allclose(noise_information(measured, weights_of(measured), COMPONENTS), expected)
    assert_allclose(
        noise_information(measured, weights_of(measured, 0.25), COMPONENTS), expected / 4
    )


def test_tracks_of_two_steps_fake_nothing_and_others_add_up():
    short = measured_of([2, 1, 2], [[0.3, 0.3, 0.3]] * 5)
    assert_allclose(noise_information(short, weights_of(short), COMPONENTS), 0)
    both = measured_of([2, 4, 8], [[0.3, 0.3, 0.3]] * 2 + [[0.1, 0.0, 0.0]] * 12)
    # 100 * 0.01 * (4 * 2 / 4 + 8 * 6 / 8)
    assert_allclose(noise_information(both, weights_of(both), COMPONENTS), np.diag([8.0, 0, 0]))


def test_rows_above_the_horizon_do_not_make_a_track_longer():
    # As measured, such rows have no direction noise; they are no rows of the track either.
    measured = measured_of([4], [[0.1, 0, 0]] * 2 + [[0, 0, 0]] * 2, [True, True, False, False])
    assert_allclose(noise_information(measured, weights_of(measured), COMPONENTS), 0)


def test_no_tracks_fake_nothing():
    none = measured_of([], np.empty((0, 3)))
    assert_allclose(noise_information(none, weights_of(none), COMPONENTS), np.zeros((3, 3)))


def test_without_noise_the_covariance_is_the_inverse():
    assert_allclose(corrected_covariance(MATRIX, np.zeros((3, 3))), np.linalg.inv(MATRIX))


def test_errors_scatter_by_all_and_are_brought_back_by_the_true_part():
    noise = np.array([[3.0, 1.0, 0.2], [1.0, 2.0, -0.5], [0.2, -0.5, 0.4]])
    true = np.linalg.inv(MATRIX - noise)
    assert_allclose(corrected_covariance(MATRIX, noise), true @ MATRIX @ true)
    # One axis alone: 4 of which 1 is noise, 4 / 3^2.
    found = corrected_covariance(np.diag([4.0, 1.0, 1.0]), np.diag([1.0, 0.0, 0.0]))
    assert_allclose(found, np.diag([4 / 9, 1.0, 1.0]))


def test_where_all_is_noise_a_twentieth_is_believed():
    found = corrected_covariance(MATRIX, 3 * MATRIX)
    assert_allclose(found, 400 * np.linalg.inv(MATRIX))
