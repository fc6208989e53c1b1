"""Speeds and places as one: asked where the camera looks by now, neither trusted over the other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.paths.reference import learn_paths
from models.paths.registration import Belief
from models.pose.fusion import fused_estimate
from models.pose.modes import birge_ratio
from models.pose.site import CameraSite
from models.simulation.walkers import WalkConfig
from models.walking.estimate import joint_at_heading, joint_estimate
from models.walking.reference_learning import learn_speed_reference
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import LENS, PRIOR, seen

SLOW = SiteConfig(aside_m=0.8, standing_share=0.0, speed_mean_mps=1.1)
FAST = replace(SLOW, speed_mean_mps=1.5)


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, SLOW, np.random.default_rng(3))


def walk(lanes, pose, count, seed):
    """One lane is a fast one: how fast people are is a matter of where and which way."""
    rng = np.random.default_rng(seed)
    return seen(
        walk_site(LENS, pose, lanes[:1], FAST, count // 3, rng)
        + walk_site(LENS, pose, lanes[1:], SLOW, count - count // 3, rng)
    )


@pytest.fixture(scope="module")
def site(lanes):
    known = walk(lanes, PRIOR, 240, 4)
    return learn_speed_reference(known, PRIOR, WalkConfig(), 0), learn_paths(known, LENS, PRIOR, 0)


def site_of(speeds, flow):
    return CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=speeds, paths=flow)


def panned(degrees):
    return replace(PRIOR, heading_rad=PRIOR.heading_rad + math.radians(degrees))


def fused(tracks, site):
    speeds, flow = site
    joint = joint_estimate(tracks, PRIOR, speeds)
    return joint, fused_estimate(tracks, site_of(speeds, flow), joint)


@pytest.mark.parametrize("degrees", [-12, 12])
def test_a_pan_alone_moves_neither_tilt_nor_roll(lanes, site, degrees):
    pose = panned(degrees)
    tracks = walk(lanes, pose, 120, 5)
    joint, found = fused(tracks, site)
    assert found.identifiable == ("tilt", "roll", "height", "heading")
    off = found.values - array_of(pose)
    assert np.abs(np.degrees(off[[0, 1, 3]])).max() < 0.5
    assert abs(off[2]) < 0.03
    # The fast lane's people are where, and go as, they did: seen with the heading that they have.
    turned = joint_at_heading(tracks, PRIOR, site[0], array_of(pose))
    assert turned.log_likelihood > joint.log_likelihood + 1


def test_speeds_asked_at_the_prior_heading_are_the_joint_estimate(lanes, site):
    tracks = walk(lanes, PRIOR, 60, 6)
    joint = joint_estimate(tracks, PRIOR, site[0])
    near = joint_at_heading(tracks, PRIOR, site[0], np.append(joint.values, PRIOR.heading_rad))
    np.testing.assert_allclose(near.values, joint.values, atol=1e-5)
    assert near.log_likelihood == pytest.approx(joint.log_likelihood, abs=1e-3)


def test_what_contradicts_is_less_sure_by_as_much():
    belief = Belief(mean=np.zeros(4), precision=np.diag([1.0, 1.0, 1.0, 1e-6]))
    known = np.diag([3.0, 1.0, 1.0, 1.0])
    # Speeds say 0, places 4 with a third of their variance: between them, 3; 3^2 + 3 (4 - 3)^2.
    assert birge_ratio(belief, known, np.array([3.0, 0.0, 0.0, 0.0])) == pytest.approx(12 / 3)
    assert birge_ratio(belief, known, np.array([0.1, 0.0, 0.0, 0.0])) == 1.0


@pytest.mark.parametrize("turn_deg", [-45, -31, 33, 40])
def test_a_camera_that_was_turned_far_is_found(lanes, site, turn_deg):
    tracks = walk(lanes, panned(turn_deg), 120, 7)
    _, found = fused(tracks, site)
    assert found.registered
    turn = math.degrees(found.values[3] - PRIOR.heading_rad)
    sd = math.degrees(math.sqrt(found.covariance[3, 3]))
    assert turn == pytest.approx(turn_deg, abs=max(3 * sd, 1.0))
    assert sd < 6
    assert found.prior_loss > 3


def test_no_heading_is_identifiable_of_people_on_ground_that_the_reference_never_saw(lanes, site):
    """Turned by 25 deg, and all but a few walk where nobody was seen before."""
    pose = panned(25)
    elsewhere = draw_lanes(LENS, panned(48), SLOW, np.random.default_rng(8))
    rng = np.random.default_rng(9)
    tracks = seen(
        walk_site(LENS, pose, lanes, SLOW, 12, rng)
        + walk_site(LENS, pose, elsewhere, SLOW, 60, rng)
    )
    joint, found = fused(tracks, site)
    assert "heading" not in found.identifiable
    np.testing.assert_array_equal(found.values[:3], joint.values)
