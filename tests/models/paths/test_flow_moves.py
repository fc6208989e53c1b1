"""A move within a window, the fit test of a flow map, and what it learns of paths that change."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.paths.likelihood import walkers_of
from models.paths.path_tests import StillScores, UsualFit, learn_scores, moved_within
from models.paths.reference import learn_paths
from models.pose.fusion import fused_estimate
from models.pose.site import CameraSite
from models.reasons import Reason, TracksCode
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import by_end
from models.tracks.walks import observe_each
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from studies.paths.flow_study import draw_new_lane, walk_changed
from studies.simulation.lanes import (
    Lane,
    SiteConfig,
    draw_lanes,
    walk_site,
)
from tests.models.sites import LENS, PRIOR

AT = array_of(PRIOR)
CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)


def feet(tracks):
    return observe_each([replace(track, top_v=None) for track in tracks], LENS)


def camera_site(speeds, flow):
    return CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=speeds, paths=flow)


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, CONFIG, np.random.default_rng(3))


@pytest.fixture(scope="module")
def known(lanes):
    return feet(walk_site(LENS, PRIOR, lanes, CONFIG, 200, np.random.default_rng(4)))


@pytest.fixture(scope="module")
def flow(known):
    reference = learn_paths(known, LENS, PRIOR, 0)
    assert reference is not None
    return reference


def walk(lanes, pose, count, seed):
    return feet(walk_site(LENS, pose, lanes, CONFIG, count, np.random.default_rng(seed)))


def test_the_level_is_passed_about_as_often_as_it_says():
    """Scores of a normal distribution of the reference's own: 400 windows, 5 % of them."""
    rng = np.random.default_rng(0)
    passed = 0
    still = learn_scores(rng.normal(0, 1, (150, 4)), np.eye(4), 0)
    for number in range(400):
        if number % 20 == 0:
            still = learn_scores(rng.normal(0, 1, (150, 4)), np.eye(4), number)
        passed += still.squares(rng.normal(0, 1, (300, 4))).max() > still.level(0.05)
    assert 2 <= passed <= 48  # 20 are expected, and windows of one reference are not independent


def test_rarer_alarms_need_more():
    still = StillScores(
        mean=np.zeros(4), covariance=np.eye(4), bent=np.eye(4), looks=10.0, walking_groups=50.0
    )
    # Student's t of 49 degrees of freedom, two-sided: 3.27 at 0.001 * 2, tables.
    assert still.level(0.02) == pytest.approx(3.265**2, rel=2e-3)
    assert still.level(1e-6) > still.level(1e-4) > still.level(1e-2)


def test_a_move_is_found_where_it_happened_and_not_twice(lanes, flow):
    turned = replace(PRIOR, heading_rad=PRIOR.heading_rad + math.radians(6))
    before = walk_site(LENS, PRIOR, lanes, CONFIG, 90, np.random.default_rng(9))
    after = walk_site(LENS, turned, lanes, CONFIG, 90, np.random.default_rng(10))
    later = [replace(track, time_s=track.time_s + 1e5) for track in after]
    site = flow.model(LENS)
    both = walkers_of(feet(before + later), AT)
    found = moved_within(both, site, AT, flow.still, 1e-6)
    assert found is not None
    assert abs(found - 90) <= 12
    for one in (feet(before), feet(after)):
        assert moved_within(walkers_of(one, AT), site, AT, flow.still, 1e-6) is None


def test_changed_paths_are_named_and_move_nothing(lanes, known, flow):
    rng = np.random.default_rng(11)
    speeds = learn_speed_reference(known, PRIOR, WalkConfig(), 0)
    new_lane = draw_new_lane(LENS, PRIOR, lanes, CONFIG, rng)
    changed = feet(walk_changed(LENS, PRIOR, lanes[1:], new_lane, CONFIG, 200, rng))
    joint = joint_estimate(changed, PRIOR, speeds)
    fused = fused_estimate(changed, camera_site(speeds, flow), joint)
    assert fused.reason == Reason(code=TracksCode.PATHS_CHANGED)
    assert not fused.registered
    np.testing.assert_allclose(fused.values[:3], joint.values)
    assert fused.values[3] == PRIOR.heading_rad
    # They are others than the reference's: a site's usual bias, 1 deg and 10 %, is not known.
    wider = np.diag(fused.covariance)[:3] - np.diag(joint.covariance)
    np.testing.assert_allclose(np.sqrt(wider), [math.radians(1), math.radians(1), 0.1])


def test_times_that_are_wrong_change_no_paths(lanes, known, flow):
    speeds = learn_speed_reference(known, PRIOR, WalkConfig(), 0)
    slow = [
        replace(track, time_s=1.5 * track.time_s)
        for track in walk_site(LENS, PRIOR, lanes, CONFIG, 120, np.random.default_rng(12))
    ]
    joint = joint_estimate(feet(slow), PRIOR, speeds)
    fused = fused_estimate(feet(slow), camera_site(speeds, flow), joint)
    assert joint.values[2] == pytest.approx(math.log(1.5 * PRIOR.height_m), abs=0.15)
    assert fused.reason is None
    np.testing.assert_allclose(fused.covariance[:3, :3], joint.covariance)


def test_a_fit_is_judged_by_its_drop():
    fit = UsualFit(mean=-1.0, sd=1.0, walking_groups=100.0)
    # t of 99 degrees at 1e-4: 3.86; times sqrt(1/16 + 1/100) = 0.2693: a drop of 1.039
    assert not fit.has_changed(np.full(16, -2.03))
    assert fit.has_changed(np.full(16, -2.05))
    assert not fit.has_changed(np.full(10_000, -1.99))  # sure, but hours differ by as much
    assert not fit.has_changed(np.empty(0))
    unknown = UsualFit(mean=np.nan, sd=np.nan, walking_groups=0.0)
    assert not unknown.has_changed(np.full(16, -9.0))


def test_the_map_says_the_less_the_worse_it_fits():
    fit = UsualFit(mean=-1.0, sd=1.0, walking_groups=100.0)
    assert fit.variance_inflation(np.full(9, -1.35)) == pytest.approx(2.0)
    assert fit.variance_inflation(np.full(9, -1.7)) == pytest.approx(5.0)
    for as_well in (np.full(9, -1.0), np.full(9, -0.5), np.empty(0)):
        assert fit.variance_inflation(as_well) == 1.0


def test_parts_of_the_day_are_told_apart_where_paths_swap(lanes):
    """Mornings on one lane, evenings on another: four maps predict better than one."""
    day_s = 86_400.0
    tracks = []
    for lane, hour in ((lanes[0], 7.0), (lanes[1], 16.0)):
        walks = walk_site(LENS, PRIOR, [lane], CONFIG, 130, np.random.default_rng(12))
        for number, track in enumerate(walks):
            shift = hour * 3600 + number % 2 * day_s - track.time_s[0] + 20 * number
            tracks.append(replace(track, time_s=track.time_s + shift))
    tracks = by_end(tracks)
    reference = learn_paths(feet(tracks), LENS, PRIOR, 0)
    assert reference is not None
    assert reference.density.slots == 4
    mixed = [replace(t, time_s=t.time_s - t.time_s[0] + 20.0 * k) for k, t in enumerate(tracks)]
    reference = learn_paths(feet(mixed), LENS, PRIOR, 0)
    assert reference is not None
    assert reference.density.slots == 1


def test_older_tracks_count_less(lanes, known):
    counted = learn_paths(known, LENS, PRIOR, 0, np.linspace(0.01, 1, known.tracks))
    evenly = learn_paths(known, LENS, PRIOR, 0)
    assert counted is not None
    assert evenly is not None
    assert evenly.people == pytest.approx(200, abs=2)
    assert counted.people == pytest.approx(150, abs=6)  # (sum w)^2 / sum w^2 of weights 0..1
    assert counted.density.people.sum() == pytest.approx(evenly.density.people.sum() / 2, rel=0.05)


def test_a_site_that_looks_alike_after_a_turn_says_so():
    """Lanes like spokes, 12 deg apart, away from the camera: 12 deg on, all is as it was."""
    angles = PRIOR.heading_rad + np.radians(np.arange(-72, 73, 12))
    spokes = [
        Lane(point=PRIOR.centre_m[:2] + 15 * way, direction=way)
        for way in np.stack([np.sin(angles), np.cos(angles)], axis=1)
    ]
    walked = SiteConfig(aside_m=0.3, standing_share=0.0)
    visible = spokes[4:9]
    rng = np.random.default_rng(13)
    known = feet(walk_site(LENS, PRIOR, visible, walked, 200, rng))
    flow = learn_paths(known, LENS, PRIOR, 0)
    assert flow is not None
    speeds = learn_speed_reference(known, PRIOR, WalkConfig(), 0)
    turned = replace(PRIOR, heading_rad=PRIOR.heading_rad + math.radians(12))
    after = feet(walk_site(LENS, turned, spokes[5:10], walked, 40, rng))
    fused = fused_estimate(after, camera_site(speeds, flow), joint_estimate(after, PRIOR, speeds))
    assert "heading" not in fused.identifiable
    assert fused.reason is not None
    assert fused.reason.code is TracksCode.HEADING_AMBIGUOUS
    turns_deg = [
        math.degrees(alternative.values[3] - PRIOR.heading_rad)
        for alternative in fused.alternatives
    ]
    turns_deg.append(math.degrees(fused.values[3] - PRIOR.heading_rad))
    assert min(abs(turn - 12) for turn in turns_deg) < 1.5
    assert np.degrees(fused.reason.values["turns_rad"]) == pytest.approx(sorted(turns_deg))
    assert math.degrees(math.sqrt(fused.covariance[3, 3])) > 5
