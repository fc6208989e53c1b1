import math
from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_t

from models.assessment.decide import is_site_changed, state_of
from models.assessment.values import CameraState
from models.errors import ShapeError
from models.pose import (
    PictureEvidence,
    PoseFinding,
    config,
    drift_of,
    of_agreeing,
    pose_posterior,
    posterior_by_picture,
    turn_by_pose,
    with_picture,
)
from models.reasons import Reason, TracksCode
from tests.models.test_hypotheses import PRIOR, estimate


def picture(tilt=0.0, roll=0.0, heading=0.0, sd=0.03):
    """A picture of a camera that turned by so many degrees."""
    return PictureEvidence(
        offset=np.radians([tilt, roll, heading]),
        covariance=np.eye(3) * math.radians(sd) ** 2,
        freedom=5.0,
        wrong=1e-4,
    )


def image(tilt=0.0, roll=0.0, heading=0.0, *, sd, inliers):
    """The evidence of an image that matched with so many inliers."""
    return PictureEvidence.of_match(
        np.radians([tilt, roll, heading]), np.eye(3) * math.radians(sd) ** 2, inliers
    )


def people(**by):
    return pose_posterior(estimate(**by), 40, PRIOR)


def test_a_turn_is_the_angles_after_less_those_before_the_short_way_round():
    prior = replace(PRIOR, heading_rad=3.1)
    after = replace(prior, tilt_rad=0.5, roll_rad=-0.03, heading_rad=-3.1)
    assert_allclose(turn_by_pose(prior, after), [0.1, -0.05, 2 * math.pi - 6.2])


def test_what_is_no_evidence_is_refused():
    with pytest.raises(ShapeError, match="offset"):
        replace(picture(), offset=np.array([0.0, 0.0, np.nan]))
    for wrong in (np.zeros((3, 3)), np.eye(2), np.diag([1.0, 1.0, -1.0])):
        with pytest.raises(ShapeError, match="covariance"):
            replace(picture(), covariance=wrong)
    with pytest.raises(ShapeError, match="freedom"):
        replace(picture(), freedom=2.0)
    with pytest.raises(ShapeError, match="wrong"):
        replace(picture(), wrong=1.1)


def test_inliers_determine_tails_and_the_chance_of_a_wrong_match():
    """Freedom 4 + n / 20; wrong 1e-4 + 1e-3 of 8 inliers, a tenth of that in each 4 more."""
    few, some, many = (image(sd=0.1, inliers=n) for n in (8, 12, 370))
    assert [each.freedom for each in (few, some, many)] == pytest.approx([4.4, 4.6, 22.5])
    assert [each.wrong for each in (few, some, many)] == pytest.approx([1.1e-3, 2e-4, 1e-4])


@pytest.mark.parametrize(
    "turn", [(0.8, 0.7, 0.8), (1.3, 0, 0), (1.5, 0.7, 0), (0, 0.9, 0.9), (1.2, 1.2, 1.2)]
)
def test_one_image_of_many_inliers_is_certain_of_a_turn_of_1_3_deg(turn):
    assert posterior_by_picture(PRIOR, image(*turn, sd=0.025, inliers=370)).moved > 0.999


def test_images_that_agree_add_up():
    """With 25 inliers, as across a change of light, one image is not certain and three are."""
    seen = image(1.5, 0.7, sd=0.12, inliers=25)
    assert posterior_by_picture(PRIOR, seen).moved < 0.95
    assert posterior_by_picture(PRIOR, of_agreeing([seen] * 3)).moved > 0.999
    still = image(0.05, 0.05, sd=0.12, inliers=25)
    assert posterior_by_picture(PRIOR, of_agreeing([still] * 8)).moved < 0.05


def test_agreeing_images_have_a_common_error_and_a_common_chance_to_be_wrong():
    """With n images of covariance C: C / 4 + 3 C / 4 n, and wrong 1e-5 + w^n, w = 1.02e-4."""
    one = image(1.0, sd=0.1, inliers=15)
    four = of_agreeing([one] * 4)
    assert_allclose(four.offset, one.offset)
    assert_allclose(four.covariance, one.covariance * (0.25 + 0.75 / 4))
    assert four.freedom == pytest.approx(4 * one.freedom)
    assert four.wrong == pytest.approx(1e-5, rel=1e-3)


def test_images_of_before_a_move_do_not_dilute_it():
    """The newest that agree count; one of before the move ends them, whatever came before it."""
    after, before = (image(tilt, sd=0.1, inliers=100) for tilt in (2.0, 0.0))
    found = of_agreeing([after, after, before, after])
    assert_allclose(found.offset, after.offset)
    assert found.freedom == pytest.approx(2 * after.freedom)
    alone = of_agreeing([after, before, before])
    assert alone is after


def test_probabilities_do_not_exceed_one():
    """Rounding made it 1.0000000000000002."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        seen = image(*rng.normal(0, 5, 3), sd=0.03, inliers=300)
        found = posterior_by_picture(PRIOR, seen)
        assert 0 <= found.moved <= 1
        assert all(0 <= share <= 1 for share in found.move.parameters.values())
        assert found.turned <= 1


def test_the_density_is_a_student_t_of_the_turn():
    """Of 5 degrees of freedom, at one and at two sd in tilt, sd 0.05 = hypot(0.03, 0.04).

    Up to the same constant, (1 + x^2 / 5) to the power of -(5 + 3) / 2: 1.2^-4 and 1.8^-4.
    """
    seen = picture(0.05)
    covariances = np.broadcast_to(np.eye(3) * math.radians(0.04) ** 2, (2, 3, 3))
    means = np.radians([[0.0, 0, 0], [-0.05, 0, 0]])
    one, two = seen.log_density(means, covariances)
    assert one - two == pytest.approx(4 * math.log(1.8 / 1.2))
    peak = multivariate_t(np.zeros(3), np.eye(3) * math.radians(0.05) ** 2, 5).logpdf(np.zeros(3))
    assert one == pytest.approx(peak - 4 * math.log(1.2))


def test_a_picture_alone_weighs_each_hypothesis_by_its_density():
    seen = picture(0.6, -0.1, 0.2)
    shares = dict(zip(range(4), config.MOVES_IN, strict=True))
    some = 1 - math.prod(1 - share for share in shares.values())
    rest, far_sd = config.REST_SD, config.MOVE_SD * 5.0
    anything = multivariate_t(np.zeros(3), np.diag(far_sd[[0, 1, 3]] ** 2) + seen.covariance, 5)
    stood = moved = 0.0
    for own in product((False, True), repeat=4):
        for far, share in ((1.0, 0.85), (5.0, 0.15)):
            odds = math.prod(shares[n] if in_it else 1 - shares[n] for n, in_it in enumerate(own))
            likely = 0.4 * odds / some + 0.3 * all(own) + 0.1 * (own == (0, 0, 1, 0))
            likely += 0.1 / 3 * (sum(own) == 1 and not own[2])
            turned = 0.1 * (far > 1 and own == (0, 0, 0, 1))
            prior = 0.2 * (share * likely + turned) if any(own) else 0.8 * share
            spread = (np.where(own, config.MOVE_SD, 0) * far) ** 2 + rest**2
            scale = np.diag(spread[[0, 1, 3]]) + seen.covariance
            right = multivariate_t(np.zeros(3), scale, 5).pdf(seen.offset)
            weight = prior * ((1 - 1e-4) * right + 1e-4 * anything.pdf(seen.offset))
            # Nobody tells anything: that the site changed is as good (0.96 + 0.02), and 0.02 are
            # for a move since then, which is 0.8 / 0.2 times as likely as one before.
            stood += 0.98 * weight * (not any(own))
            moved += (0.98 + 0.02 * 0.8 / 0.2) * weight * any(own)
    found = posterior_by_picture(PRIOR, seen)
    assert found.moved == pytest.approx(moved / (moved + stood))
    assert 0.1 < found.moved < 0.9


@pytest.mark.parametrize("name", ["tilt", "roll", "heading"])
def test_one_picture_tells_a_knock_and_not_the_height(name):
    found = posterior_by_picture(PRIOR, picture(**{name: 5.0}))
    assert found.moved > 0.999
    drift = drift_of(found, estimate(identifiable=()))
    assert drift.identifiable == ("tilt", "roll", "heading")
    assert math.degrees(drift.by.of(f"{name}")) == pytest.approx(5.0, abs=0.05)
    assert math.degrees(drift.sd.of(f"{name}")) < 0.1
    assert drift.sd.height_m / PRIOR.height_m > 0.08  # 0.10 where it moved


def test_a_sway_is_no_move():
    assert posterior_by_picture(PRIOR, picture(0.2, 0.1, -0.2)).moved < 0.1


def test_a_still_picture_ends_a_doubt():
    doubt = people(tilt=1.4)
    assert doubt.moved > 0.5
    assert with_picture(doubt, picture()).moved < 0.05


def test_both_together_are_surer_than_either_and_the_height_is_the_peoples():
    by, seen = people(tilt=1.2, log_height=0.2), picture(1.2)
    both = with_picture(by, seen)
    assert both.moved > max(by.moved, posterior_by_picture(PRIOR, seen).moved)
    assert both.parameters.height_m == pytest.approx(PRIOR.height_m * math.exp(0.2), rel=0.02)
    assert both.sd.tilt_rad < 0.2 * by.sd.tilt_rad


def test_people_who_walk_elsewhere_before_a_camera_that_stands_are_a_site_that_changed():
    by = people(tilt=3.0, heading=8.0)
    assert by.moved > 0.999
    both = with_picture(by, picture())
    assert both.moved < 0.1
    assert both.site_changed > 0.99
    assert np.abs(np.degrees(both.offset)).max() < 0.05
    fused = estimate(tilt=3.0, heading=8.0)
    assert state_of(both, fused) == CameraState.OK
    assert is_site_changed(both, fused)
    assert state_of(by, fused) == CameraState.SUSPECTED


def test_people_who_walked_before_the_knock_do_not_hide_it():
    both = with_picture(people(), picture(5.0))
    assert both.moved > 0.99
    assert both.site_changed < 0.1
    assert math.degrees(both.offset[0]) == pytest.approx(5.0, abs=0.1)


def test_a_still_picture_of_unknown_paths_says_that_the_site_changed():
    lost = estimate(reason=Reason(code=TracksCode.PATHS_CHANGED, values={}), raw=None)
    by = pose_posterior(lost, 40, PRIOR)
    assert state_of(by, lost) == CameraState.UNSURE
    both = with_picture(by, picture())
    assert state_of(both, lost) == CameraState.OK
    assert is_site_changed(both, lost)


def test_a_picture_of_people_who_tell_little_says_that_the_camera_stands():
    few = pose_posterior(estimate(), 2, PRIOR)
    fused = estimate(identifiable=(), sd=np.full(4, 1.0))
    assert state_of(few, fused) == CameraState.LEARNING
    both = with_picture(few, picture())
    assert state_of(both, fused) == CameraState.OK


def test_without_a_picture_nothing_differs():
    class Joint:
        walking_groups = 40

    fused = estimate(1.0, -0.4, 0.02, 0.9)
    found = PoseFinding(prior=PRIOR, joint=Joint(), fused=fused)
    alone = pose_posterior(fused, 40, PRIOR)
    for field in fields(alone):
        assert_array_equal(getattr(found.posterior, field.name), getattr(alone, field.name))
    assert not found.posterior.pictured
    seen = replace(found, factors=(picture(5.0),)).posterior
    assert seen.pictured
    assert seen.moved > alone.moved
