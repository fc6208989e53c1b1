import math

import numpy as np
import pytest

from models.errors import ShapeError
from studies.plane_estimate import PlaneEstimate


@pytest.mark.parametrize(
    ("values", "covariance"),
    [(np.zeros(2), np.eye(3)), (np.zeros(3), np.eye(2)), (np.array([0, math.nan, 0]), np.eye(3))],
)
def test_what_is_no_triple_is_refused(values: np.ndarray, covariance: np.ndarray):
    with pytest.raises(ShapeError, match="values, covariance"):
        PlaneEstimate(values=values, covariance=covariance, tracks=5)
