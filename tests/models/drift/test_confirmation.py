"""Whether two estimates are of two poses: their distance in their own deviations, by hand."""

import numpy as np
import pytest

from models.drift.confirmation import moved_beyond_doubt
from models.estimation.joint.estimate import JointEstimate
from models.estimation.parameters import PLANE_PARAMETERS


def estimate(values=(0.3, 0.0, 1.8), covariance=None, unidentifiable=()):
    covariance = np.diag([1e-4, 1e-4, 1e-4]) if covariance is None else np.array(covariance)
    return JointEstimate(
        values=np.array(values),
        covariance=covariance,
        raw=np.array(values) + 5.0,  # before the reference's offset: nothing to go by
        bound=np.eye(3),
        walkers=40,
        walking_groups=40,
        identifiable=tuple(name for name in PLANE_PARAMETERS if name not in unidentifiable),
        reason="",
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_limit_is_twice_a_millionths_chi_squared(axis, sign):
    # Variances 1e-4 and 2e-4 add up: 0.135^2 / 3e-4 = 60.75 and 0.1365^2 / 3e-4 = 62.1.
    before = estimate()
    for apart, moved in ((0.135, False), (0.1365, True)):
        after = before.values.copy()
        after[axis] += sign * apart
        found = estimate(after, covariance=np.diag([2e-4] * 3))
        assert moved_beyond_doubt(before, found) is moved
        assert moved_beyond_doubt(found, before) is moved


def test_numbers_that_make_up_for_each_other_are_apart_across_that_alone():
    # Together [[2, 1], [1, 2]] e-4: along (1, 1) a step of 0.07 counts 32.7, along (1, -1) 98.
    tied = 0.5e-4 * np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 2.0]])
    before = estimate(covariance=tied)
    along = estimate(before.values + [0.07, 0.07, 0.0], covariance=tied)
    across = estimate(before.values + [0.07, -0.07, 0.0], covariance=tied)
    assert not moved_beyond_doubt(before, along)
    assert moved_beyond_doubt(before, across)


def test_a_cut_must_leave_a_pose_behind_it():
    before, far = estimate(), (0.9, 0.0, 1.8)
    assert moved_beyond_doubt(before, estimate(far))
    assert not moved_beyond_doubt(before, estimate(far, unidentifiable=("roll",)))
    assert moved_beyond_doubt(estimate(unidentifiable=("roll",)), estimate(far))


def test_the_same_estimate_has_not_moved():
    assert not moved_beyond_doubt(estimate(), estimate())
