"""The search for a change: wherever the camera stands, and whatever the crowd does."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.paths.likelihood import walkers_of
from models.paths.path_tests import moved_within
from models.pose import estimate_pose, learn_site
from models.pose.change_point import least_covariance
from models.pose.estimating import pose_fit_of
from models.tracks.observations import of_tracks
from models.tracks.trajectory import by_end
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import KNOCKED, LENS, PRIOR, seen

CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)
PANNED = replace(KNOCKED, heading_rad=PRIOR.heading_rad + math.radians(5))


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, CONFIG, np.random.default_rng(3))


@pytest.fixture(scope="module")
def site(lanes):
    known = walk_site(LENS, PRIOR, lanes, CONFIG, 150, np.random.default_rng(4))
    return learn_site(seen(by_end(known)), LENS, PRIOR, chart=False)


def window(*parts, seed):
    """Tracks of lanes, poses and numbers of people, one part after the other."""
    rng = np.random.default_rng(seed)
    tracks, begin_s = [], 0.0
    for lanes, pose, count in parts:
        part = walk_site(LENS, pose, lanes, CONFIG, count, rng)
        tracks += [replace(track, time_s=track.time_s + begin_s) for track in part]
        begin_s = max(float(track.time_s[-1]) for track in tracks) + 20
    return seen(by_end(tracks))


def test_a_crowd_that_changes_its_ways_before_a_knocked_camera_is_no_move(site, lanes):
    """First one lane's people, then the others': from the prior pose, that is a move."""
    tracks = window((lanes[:1], KNOCKED, 50), (lanes[1:], KNOCKED, 60), seed=5)
    at = array_of(PRIOR)
    paths = site.paths.model(LENS)
    assert moved_within(walkers_of(tracks, at), paths, at, site.paths.still, 1e-6) is not None
    assert estimate_pose(tracks, site).change_idx is None


@pytest.mark.parametrize("first", [PRIOR, KNOCKED])
@pytest.mark.parametrize("number", ["tilt_rad", "roll_rad", "heading_rad"])
def test_a_turn_by_5_deg_is_found_within_40_people(site, lanes, first, number):
    after = replace(first, **{number: getattr(first, number) + math.radians(5)})
    tracks = window((lanes, first, 80), (lanes, after, 40), seed=6)
    found = estimate_pose(tracks, site)
    assert found.change_idx == pytest.approx(80, abs=8)
    off = array_of(found.pose) - array_of(after)
    assert np.abs(np.degrees(off[[0, 1, 3]])).max() < 1.5


def test_a_pose_after_a_change_is_less_sure_than_one_of_as_many_people(site, lanes):
    tracks = window((lanes, PRIOR, 80), (lanes, PANNED, 40), seed=7)
    found = estimate_pose(tracks, site)
    assert found.change_idx is not None
    alone = pose_fit_of(of_tracks(tracks, np.arange(found.first, tracks.tracks)), site)
    np.testing.assert_array_equal(found.fused.values, alone.fused.values)
    more = np.linalg.eigvalsh(found.fused.covariance - alone.fused.covariance)
    assert more.min() > -1e-12
    assert more.max() > 1e-9


def test_no_people_are_surer_than_the_reference_s_were_twice_over(site):
    few, many = (least_covariance(count, site.speed_reference, site.paths) for count in (10, 40))
    ratio = np.sqrt(np.diag(few) / np.diag(many))
    assert (ratio > 1.5).all()
    assert (ratio < 2.01).all()  # the root of four times as many
    without = least_covariance(10, site.speed_reference, None)
    assert (np.diag(without)[:3] > np.diag(few)[:3]).all()
    assert math.sqrt(without[3, 3]) == pytest.approx(math.radians(7.5), rel=1e-3)
    # Of as many people as the reference had, twice as sure as it was of its own offset at most.
    whole = least_covariance(site.speed_reference.tracks, site.speed_reference, None)
    own = np.sqrt(np.diag(site.speed_reference.offset_covariance) / np.diag(whole)[:3])
    assert (own < 2.05).all()
