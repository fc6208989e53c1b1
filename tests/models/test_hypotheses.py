import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_t, norm

from models.assessment.decide import is_detectable
from models.geometry.pose import PARAMETERS, CameraPose, array_of
from models.pose import config, drift_of, pose_posterior
from models.pose.pose_fit import FusedEstimate
from models.reasons import Reason, TracksCode

PRIOR = CameraPose(height_m=6.0, tilt_rad=0.4, roll_rad=0.02, heading_rad=2.0)
SD = np.array([math.radians(0.3), math.radians(0.5), 0.03, math.radians(0.8)])


def estimate(tilt=0.0, roll=0.0, log_height=0.0, heading=0.0, *, sd=SD, correlation=None, **other):
    """An estimate that is so far from the prior pose, angles in degrees."""
    offset = np.array([math.radians(tilt), math.radians(roll), log_height, math.radians(heading)])
    values = array_of(PRIOR) + offset
    covariance = np.outer(sd, sd) * (np.eye(4) if correlation is None else correlation)
    own = {"identifiable": PARAMETERS, "reason": None, "raw": values, **other}
    return FusedEstimate(values=values, covariance=covariance, **own)


def test_the_weights_are_those_of_a_student_t_for_each_subset():
    fused, groups = estimate(1.0, -0.4, 0.02, 0.9), 30
    offset, degrees = fused.values - array_of(PRIOR), 4 + 30 / 4
    weights = []
    shares = dict(zip(range(4), config.MOVES_IN, strict=True))
    for moved in product((False, True), repeat=4):
        odds = math.prod(shares[n] if own else 1 - shares[n] for n, own in enumerate(moved))
        some = 1 - math.prod(1 - share for share in shares.values())
        for far, share in ((1.0, 0.85), (5.0, 0.15)):
            spread = np.where(moved, config.MOVE_SD, 0) * far
            scale = fused.covariance + np.diag(spread**2)
            likely = multivariate_t(np.zeros(4), scale, degrees).pdf(offset)
            # Of moves: 0.4 by each parameter itself, 0.3 all, 0.1 one angle, 0.1 the scale, 0.1 a
            # far pan.
            angle = sum(moved) == 1 and not moved[2]
            own = 0.4 * odds / some + 0.3 * all(moved) + 0.1 * (moved == (0, 0, 1, 0))
            own += 0.1 / 3 * angle
            turned = 0.1 * (far > 1 and moved == (0, 0, 0, 1))
            prior = 0.2 * (share * own + turned) if any(moved) else 0.8 * share
            weights.append((moved, prior * likely))
    whole = sum(weight for _, weight in weights)
    found = pose_posterior(fused, groups, PRIOR)
    assert found.moved == pytest.approx(sum(w for m, w in weights if any(m)) / whole)
    for number, name in enumerate(PARAMETERS):
        share = sum(weight for moved, weight in weights if moved[number]) / whole
        assert found.move.parameters[name] == pytest.approx(share)


def test_a_camera_that_stands_is_served_where_it_stands():
    found = pose_posterior(estimate(0.2, -0.3, 0.01, 0.4), 40, PRIOR)
    assert found.moved < 0.05
    assert np.abs(np.degrees(found.offset)).max() < 0.05
    # How surely, does not lean on how seldom cameras move: 1.645 sd of 0.3 deg to either side of
    # 0.2 deg, by the variance of a t of 14 degrees of freedom (14 + 0.9) / (14 + 4 - 2), and 0.1.
    half = 1.645 * math.hypot(0.3 * math.sqrt(14.9 / 16), 0.1)
    low, high = (math.degrees(end) for end in found.interval("tilt", 0.9))
    assert (low, high) == (pytest.approx(0.2 - half, abs=0.02), pytest.approx(0.2 + half, abs=0.02))
    assert math.degrees(found.sd.tilt_rad) == pytest.approx(math.hypot(half / 1.645, 0.2), abs=0.02)


def test_the_served_pose_is_in_its_own_interval():
    found = pose_posterior(estimate(1.4), 20, PRIOR)
    assert found.moved < 0.9  # so that the pose served is near the prior pose
    low, high = found.interval("tilt", 0.5)
    assert low == found.offset[0]
    assert high == pytest.approx(math.radians(1.4), abs=math.radians(0.3))


@pytest.mark.parametrize(
    ("name", "by"), [("tilt", 4.0), ("roll", -5.0), ("log_height", 0.3), ("heading", 8.0)]
)
def test_what_moved_is_named_and_the_rest_stands(name, by):
    found = pose_posterior(estimate(**{name: by}), 40, PRIOR)
    parameter = name.removeprefix("log_")
    assert found.moved > 0.99
    for other, share in found.move.parameters.items():
        assert share > 0.99 if other == parameter else share < 0.2
    true = by if name == "log_height" else math.radians(by)
    assert found.offset[PARAMETERS.index(parameter)] == pytest.approx(true, rel=0.05)
    low, high = found.interval(parameter, 0.9)
    assert low < true < high
    assert found.turned == pytest.approx(1.0 if parameter != "height" else 0.2, abs=0.2)


def test_a_height_does_not_take_what_the_tilt_should_have():
    together = np.eye(4)
    together[0, 2] = together[2, 0] = 0.9
    # As people's chance would have it: 1.5 sd too high, and the tilt 1.5 sd too large by that.
    found = pose_posterior(estimate(4.45, log_height=0.045, correlation=together), 40, PRIOR)
    assert math.degrees(found.offset[0]) == pytest.approx(4.05, abs=0.15)
    assert abs(found.offset[2]) < 0.02


def test_few_groups_say_less():
    shares = [pose_posterior(estimate(1.5), groups, PRIOR).moved for groups in (5, 20, 100)]
    assert shares == sorted(shares)
    assert shares[0] < 0.9 < shares[-1]


def test_who_fits_far_worse_at_the_prior_pose_is_not_before_a_camera_that_stands():
    wide = SD * np.array([1, 1, 1, 8])
    alone = pose_posterior(estimate(heading=12, sd=wide), 40, PRIOR)
    assert alone.moved < 0.9
    beside = pose_posterior(estimate(heading=12, sd=wide, prior_gap=40.0), 40, PRIOR)
    # Hours differ by 1.5 + 40 * 0.03 = 2.7 times chance. A Gaussian makes it (12 / 6.4)^2 = 3.52;
    # by a t of 14 degrees of freedom and four numbers standing is so much less likely.
    less = ((1 + 40 / 2.7 / 14) / (1 + (12 / 6.4) ** 2 / 14)) ** -9
    stands = less * (1 - alone.moved)
    assert beside.moved == pytest.approx(alone.moved / (alone.moved + stands))
    # What the Gaussian says is enough where people lose as little as those of another hour.
    hourly = pose_posterior(estimate(heading=12, sd=wide, prior_gap=9.0), 40, PRIOR)
    assert hourly.moved == pytest.approx(alone.moved)


def test_a_mode_that_is_no_gaussian_says_no_more_against_the_prior_pose_than_people_do():
    far = estimate(4.0, sd=SD * 3)  # 4.4 sd
    assert pose_posterior(far, 40, PRIOR).moved > 0.9
    # People are as likely at the prior pose: as if the estimate were there, seen from standing.
    flat = replace(far, prior_gap=0.0)
    assert pose_posterior(flat, 40, PRIOR).moved < 0.1


def test_a_heading_that_paths_do_not_hold_says_nothing():
    found = pose_posterior(estimate(0.1, raw=None), 40, PRIOR)
    standing = pose_posterior(estimate(0.1), 40, PRIOR)
    assert found.move.parameters["heading"] > 3 * standing.move.parameters["heading"]
    away = pose_posterior(estimate(0.1, heading=40, raw=None), 40, PRIOR)
    assert away.moved == pytest.approx(found.moved)


def test_paths_that_are_gone_leave_it_open_whether_the_camera_turned_away():
    gone = Reason(code=TracksCode.PATHS_CHANGED)
    found = pose_posterior(estimate(raw=None, reason=gone), 40, PRIOR)
    assert 0.1 < found.moved < 0.6
    assert found.move.parameters["heading"] > 0.5 * found.moved


def test_an_interval_is_of_all_that_may_have_moved_near_and_far():
    found = pose_posterior(estimate(heading=3.8, sd=SD * 5), 20, PRIOR)
    low, high = found.interval("heading", 0.9)
    at = [15, 30]  # the last of the 16 subsets, and of the 15 far ones
    weights = found.weights[at] / found.weights[at].sum()
    spread = norm(found.means[at, 3], np.sqrt(found.covariances[at, 3, 3]))
    assert weights @ spread.cdf(low) == pytest.approx(0.05, abs=1e-6)
    assert weights @ spread.cdf(high) == pytest.approx(0.95, abs=1e-6)


def noticed(fused, *, mapped=True):
    return is_detectable(pose_posterior(fused, 40, PRIOR), fused, mapped=mapped)


def test_steady_is_said_only_where_a_turn_would_have_been_noticed():
    gone = Reason(code=TracksCode.PATHS_CHANGED)
    assert noticed(estimate())
    assert not noticed(estimate(sd=SD * [1, 1, 1, 4]))
    assert not noticed(estimate(sd=SD * [11, 1, 1, 1]))
    assert not noticed(estimate(raw=None))
    assert noticed(estimate(raw=None), mapped=False)
    assert not noticed(estimate(raw=None, reason=gone), mapped=False)
    assert not noticed(estimate(heading=8))


def drift(fused):
    return drift_of(pose_posterior(fused, 40, PRIOR), fused)


def test_a_heading_that_surely_moved_is_not_told_where_nobody_can_tell_how_far():
    three = PARAMETERS[:3]
    wide = SD * np.array([1, 1, 1, 4])
    found = drift(estimate(heading=30, sd=wide, identifiable=three))
    assert found.identifiable == three
    assert found.move.parameters["heading"] > 0.99  # the verdict says so


def test_who_are_too_few_to_say_anything_say_nothing_of_the_prior_pose_either():
    few = pose_posterior(estimate(3.0, prior_gap=60.0), 4, PRIOR)
    assert not few.seen.any()
    assert few.moved == pytest.approx(config.MOVED_PRIOR)
