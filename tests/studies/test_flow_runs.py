"""The protocol's columns of the flow map, and what estimators share of a case."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import by_end
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from studies.protocol.cases import ProtocolCase, judge_answer
from studies.protocol.estimators import joint, joint_feet
from studies.protocol.flow_runs import fused, registration
from studies.protocol.learned import learn_case
from studies.simulation.lanes import SiteConfig
from tests.models.sites import KNOCKED, LENS, PRIOR, seen, tracks_of

pytestmark = pytest.mark.slow

TURNED = replace(KNOCKED, heading_rad=math.radians(7))


def case_of(known, after) -> ProtocolCase:
    return ProtocolCase(
        scene_id="simulated",
        seed=0,
        intrinsics=LENS,
        prior_pose=PRIOR,
        true_pose=TURNED,
        reference=tuple(by_end(known)),
        seen=tuple(by_end(after)),
    )


@pytest.fixture(scope="module")
def learned():
    config = SiteConfig(aside_m=0.8, standing_share=0.0)
    known, after = tracks_of(3, (PRIOR, 200), (TURNED, 100), config=config, boxes=True)
    return learn_case(case_of(known, after))


def test_what_is_shared_is_what_each_would_learn(learned):
    for boxed, answer in ((True, joint(learned)), (False, joint_feet(learned))):
        known, after = (
            [track if boxed else replace(track, top_v=None) for track in tracks]
            for tracks in (learned.case.reference, learned.case.seen)
        )
        reference = learn_speed_reference(seen(known), PRIOR, WalkConfig(), 0)
        alone = joint_estimate(seen(after), PRIOR, reference)
        assert_array_equal(answer.values, alone.values)
        assert_array_equal(answer.covariance, alone.covariance)
    assert learned.site.speed_reference.statures is not None
    assert learned.feet_speed_reference.statures is None


def test_the_map_alone_finds_the_camera_again_without_any_speed(learned):
    # People who hurry: for speeds, a lower camera; for places, nothing.
    hurried = [replace(track, time_s=track.time_s / 1.3) for track in learned.case.seen]
    after = seen(hurried)
    found = registration(replace(learned, seen=after))
    outcome = judge_answer(learned.case, "registration", found, 0.0)
    assert outcome.angle_error_deg < 1.7
    assert outcome.height_error < 0.1
    assert all(outcome.covered)
    assert outcome.heading_covered
    feet = seen([replace(track, top_v=None) for track in hurried])
    by_speeds = judge_answer(learned.case, "joint", joint_feet(replace(learned, feet=feet)), 0.0)
    assert by_speeds.height_error > 0.15


def test_speeds_make_the_map_surer(learned):
    alone, both = registration(learned), fused(learned)
    assert both.heading_rad == pytest.approx(TURNED.heading_rad, abs=math.radians(0.7))
    assert (np.diag(both.covariance) <= np.diag(alone.covariance)).all()


def test_without_a_map_registration_says_nothing_and_fused_is_the_joint_estimate(learned):
    blind = replace(learned, site=replace(learned.site, paths=None))
    nothing = registration(blind)
    assert (nothing.tracks, nothing.identifiable, nothing.heading_rad) == (0, (), None)
    assert_array_equal(fused(blind).values, joint(blind).values)
    assert fused(blind).heading_rad is None
    few = replace(learned, seen=seen(list(learned.case.seen[:3])))
    assert registration(few).tracks == 0
