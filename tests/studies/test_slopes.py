import numpy as np
import pytest

from studies.slopes import slope_with_error


def test_a_line_has_its_slope_whatever_it_begins_at():
    true = np.array([-2.0, 0.0, 1.0, 5.0])
    assert slope_with_error(true, 7 + 0.8 * true) == (
        pytest.approx(0.8),
        pytest.approx(0, abs=1e-9),
    )


def test_the_error_is_that_of_least_squares():
    # Residuals of 1, -2, 1 about a line through three points one apart: 6 / 1 freedom / 2 of power.
    slope, error = slope_with_error(np.array([0.0, 1.0, 2.0]), np.array([1.0, -1.0, 3.0]))
    assert slope == pytest.approx(1.0)
    assert error == pytest.approx(np.sqrt(6 / 2))


@pytest.mark.parametrize("true", [[0.0, 1.0], [2.0, 2.0, 2.0], []])
def test_too_few_or_all_the_same_tell_no_slope(true):
    assert slope_with_error(np.array(true), np.array(true)) == (None, None)
