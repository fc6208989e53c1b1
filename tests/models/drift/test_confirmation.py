"""Whether two estimates are of two poses: their distance in their own deviations, by hand."""

import numpy as np
import pytest

from models.drift.confirmation import moved_beyond_doubt
from models.flow.fusion import FusedEstimate
from models.geometry.pose_parameters import PARAMETERS


def estimate(values=(0.3, 0.0, 1.8, 0.1), covariance=None, identifiable=PARAMETERS):
    covariance = np.diag([1e-4] * 4) if covariance is None else np.array(covariance)
    return FusedEstimate(
        values=np.array(values),
        covariance=covariance,
        identifiable=identifiable,
        reason=None,
        raw=np.array(values) + 5.0,  # before the map's bias: nothing to go by
    )


def moved(before, after, groups_before=300, groups_after=300):
    return moved_beyond_doubt(before, groups_before, after, groups_after)


@pytest.mark.parametrize("axis", [0, 1, 2, 3])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_limit_is_hotelling_s(axis, sign):
    # F of 4 and 296 at 1e-4 is 6.097; times 4 * 299 / 296: 24.63. Variances 1e-4 and 2e-4 add up.
    before = estimate()
    for apart, expected in ((0.0857, False), (0.0863, True)):
        after = before.values.copy()
        after[axis] += sign * apart
        found = estimate(after, covariance=np.diag([2e-4] * 4))
        assert moved(before, found) is expected
        assert moved(found, before) is expected


def test_few_groups_must_be_farther_apart():
    before, after = estimate(), estimate((0.42, 0.0, 1.8, 0.1))  # 0.12^2 / 2e-4 = 72: of 40, 34.7
    assert moved(before, after, 300, 40)
    assert moved(before, after, 40, 300)
    assert not moved(before, after, 300, 12)
    assert not moved(before, after, 12, 300)
    assert not moved(before, estimate((1.5, 0.0, 1.8, 0.1)), 6, 300)


def test_parameters_that_make_up_for_each_other_are_apart_across_that_alone():
    # Together [[2, 1], [1, 2]] e-4: along (1, 1) a step of 0.05 counts 17, along (1, -1) 50.
    tied = 0.5e-4 * np.array(
        [[2.0, 1.0, 0.0, 0.0], [1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 2.0]]
    )
    before = estimate(covariance=tied)
    along = estimate(before.values + [0.05, 0.05, 0.0, 0.0], covariance=tied)
    across = estimate(before.values + [0.05, -0.05, 0.0, 0.0], covariance=tied)
    assert not moved(before, along)
    assert moved(before, across)


def test_a_cut_must_leave_a_pose_behind_it():
    before, far = estimate(), (0.9, 0.0, 1.8, 0.1)
    assert moved(before, estimate(far))
    assert not moved(before, estimate(far, identifiable=("tilt", "height", "heading")))
    assert moved(before, estimate(far, identifiable=("tilt", "roll", "height")))
    assert moved(estimate(identifiable=("tilt", "height", "heading")), estimate(far))


def test_the_same_estimate_has_not_moved():
    assert not moved(estimate(), estimate())
