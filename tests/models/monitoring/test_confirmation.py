"""Whether two estimates are of two poses: their distance in their own deviations, by hand."""

import numpy as np
import pytest

from models.geometry.pose import PARAMETERS
from models.pose.change_point import moved_beyond_doubt
from models.pose.pose_fit import FusedEstimate


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
    # F of 4 and 36 at 1e-4 is 8.011; times 4 * 39 / 36: 34.71. Variances of 1e-2 and 2e-2 add up,
    # so wide that habits decide nothing.
    before = estimate(covariance=np.diag([1e-2] * 4))
    for apart, expected in ((1.01, False), (1.03, True)):  # 1.0205 ** 2 / 3e-2 = 34.71
        after = before.values.copy()
        after[axis] += sign * apart
        found = estimate(after, covariance=np.diag([2e-2] * 4))
        assert moved(before, found, 300, 40) is expected
        assert moved(found, before, 40, 300) is expected


# By hand: 28.47 is what a chi square of 4 is above once in 1e5. Of tilt and roll the habits of two
# parts have variances of 2 * 0.2 deg ** 2 = 2.437e-5, of log heights 2 * (0.01 ** 2 + 0.03 ** 2) =
# 2e-3, of headings 2 * 0.3 deg ** 2 = 5.483e-5; the estimates' are nothing beside them.
@pytest.mark.parametrize(("axis", "limit"), [(0, 0.02634), (1, 0.02634), (2, 0.2386), (3, 0.03951)])
def test_nor_may_it_be_a_habit(axis, limit):
    sure = np.diag([1e-10] * 4)
    before = estimate(covariance=sure)
    for share, expected in ((0.99, False), (1.01, True)):
        after = before.values.copy()
        after[axis] += share * limit
        assert moved(before, estimate(after, covariance=sure)) is expected


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


def test_what_has_moved_the_farthest_is_known_where_it_is_now_and_all_of_where_it_was():
    before, far = estimate(), (0.3, 0.9, 1.9, 0.1)
    assert moved(before, estimate(far))
    assert moved(before, estimate(far, identifiable=("roll",)))
    assert not moved(before, estimate(far, identifiable=("tilt", "height", "heading")))
    assert not moved(estimate(identifiable=("tilt", "roll", "heading")), estimate(far))
    turned = estimate((0.3, 0.0, 1.8, 0.5), identifiable=("tilt", "roll", "height"))
    assert not moved(before, turned)


def test_the_same_estimate_has_not_moved():
    assert not moved(estimate(), estimate())
