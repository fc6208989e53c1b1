"""Simulated sites of the study: new paths are new, and results are those of the poses told."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import ground_from_pixel
from studies.paths.flow_study import draw_new_lane, study_site, walk_changed
from studies.simulation.lanes import (
    Lane,
    SiteConfig,
    draw_lanes,
)
from studies.simulation.simulated_site import draw_simulated_site
from tests.models.sites import LENS, PRIOR

pytestmark = pytest.mark.slow

QUIET = SiteConfig(noise_px=0.0, standing_share=0.0, aside_m=0.0)


def aside_m(lane: Lane, place: np.ndarray) -> float:
    return float(abs((place - lane.point) @ [-lane.direction[1], lane.direction[0]]))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_new_lane_is_off_the_old_ones_and_goes_another_way(seed):
    rng = np.random.default_rng(seed)
    lanes = draw_lanes(LENS, PRIOR, QUIET, rng)
    new = draw_new_lane(LENS, PRIOR, lanes, QUIET, rng)
    assert min(aside_m(lane, new.point) for lane in lanes) > 3
    # Three lanes are 60 deg apart: midway is 30 deg from two of them.
    between = sorted(math.acos(min(abs(lane.direction @ new.direction), 1.0)) for lane in lanes)
    assert_allclose(np.degrees(between), [30, 30, 90], atol=1e-6)


def test_every_other_walks_the_new_lane_and_one_sets_out_after_another():
    rng = np.random.default_rng(0)
    lanes = draw_lanes(LENS, PRIOR, QUIET, rng)
    new = draw_new_lane(LENS, PRIOR, lanes, QUIET, rng)
    tracks = walk_changed(LENS, PRIOR, lanes[1:], new, QUIET, 41, rng)
    assert [track.time_s[0] for track in tracks] == [20.0 * number for number in range(41)]
    for number, track in enumerate(tracks):
        ground, _ = ground_from_pixel(LENS, PRIOR.rotation, PRIOR.centre_m, track.uv)
        walked = [new] if number % 2 else lanes[1:]
        assert min(aside_m(lane, ground[0]) for lane in walked) < 1e-6, number


def test_the_same_site_gives_the_same_results_and_a_knock_is_told():
    sizes = {"reference_tracks": 300, "knocked_tracks": (60,), "changed_tracks": (40,)}
    first, again = (study_site(3, 5, **sizes) for _ in range(2))
    assert (first.knocked, first.changed) == (again.knocked, again.changed)
    (told,) = first.knocked
    assert told.tracks == 60
    assert abs(math.degrees(first.knock.heading_rad)) <= 8
    assert told.angle_error_deg < 2.0
    # The whole angle of small errors is no more than their sum, and no less than the largest less
    # what tilt and roll take off a turn about the vertical.
    assert told.angle_error_deg <= sum(map(abs, told.errors[:3])) + 1e-6
    (changed,) = first.changed
    assert changed.unchanged_off_truth_deg < 1.0
    # Three poses make a triangle of rotations.
    assert changed.off_unchanged_deg <= (
        changed.off_truth_deg + changed.unchanged_off_truth_deg + 1e-6
    )


def test_simulated_sites_differ_and_people_are_seen():
    drawn = [draw_simulated_site(np.random.default_rng(seed)) for seed in range(4)]
    assert len({site.intrinsics.fx for site in drawn}) == 4
    assert all(4 <= site.prior.height_m <= 9 for site in drawn)
    assert {len(site.lanes) for site in drawn} <= {2, 3, 4}
