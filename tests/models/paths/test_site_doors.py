"""Doors of a simulated site, whose truth is known: found, worth something, and absent without."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from models.paths.folds import fold_maps
from models.paths.likelihood import walkers_of
from models.paths.reference import candidate_of, learn_flow
from models.paths.serialization import flow_from_bytes, flow_to_bytes
from models.paths.turn_detection import moved_within
from models.pose.estimating import estimate_pose
from models.pose.learning import learn_site
from models.simulation.pose_offset import Knock
from models.simulation.simulated_site import SiteConfig, draw_lanes, walk_site
from models.tracks.exposure import ENDS
from models.tracks.trajectory import by_end
from models.tracks.walks import observe
from tests.models.sites import LENS, PRIOR

CONFIG = SiteConfig(standing_share=0.0)
PANNED = Knock(heading_rad=math.radians(5)).apply(PRIOR)
AT = candidate_of(PRIOR)


def observed(tracks):
    return observe(by_end(replace(track, top_v=None) for track in tracks), LENS, PRIOR)


@pytest.fixture(scope="module")
def lanes():
    """Each begins where its point is, in the middle of the picture's ground."""
    drawn = draw_lanes(LENS, PRIOR, CONFIG, np.random.default_rng(5))
    return [replace(lane, doors_m=(0.0, math.inf)) for lane in drawn]


def walk(lanes, pose, count, seed, since_s=0.0):
    tracks = walk_site(LENS, pose, lanes, CONFIG, count, np.random.default_rng(seed))
    return [replace(track, time_s=track.time_s + since_s) for track in tracks]


@pytest.fixture(scope="module")
def known(lanes):
    return observed(walk(lanes, PRIOR, 300, 6))


@pytest.fixture(scope="module")
def site(known):
    return learn_site(known, LENS, PRIOR, chart=False)


def test_doors_are_where_lanes_begin(lanes, site):
    doors = site.flow.doors
    assert doors is not None
    for lane in lanes:
        column, row = np.rint((lane.point - doors.corner) / doors.cell_m).astype(int)
        around = doors.ratio[column - 6 : column + 7, row - 6 : row + 7, ENDS]  # 1.5 m either way
        assert around.max() > 5
    assert np.median(doors.ratio) == pytest.approx(1.0, abs=0.02)  # nobody was there


def test_they_make_a_heading_surer_and_hold(lanes, known, site):
    after = observed(walk(lanes, PANNED, 100, 7))
    bare = learn_site(replace(known, moments=None), LENS, PRIOR, chart=False)
    assert bare.flow.doors is None
    with_doors, without = (estimate_pose(after, each).fused for each in (site, bare))
    sds = [np.sqrt(np.diag(each.covariance)) for each in (with_doors, without)]
    assert sds[0][3] < 0.8 * sds[1][3]
    off = with_doors.values - candidate_of(PANNED)
    assert abs(off[3]) < math.radians(1.0)
    assert (np.abs(off) < 3 * sds[0]).all()


def test_a_pan_in_the_midst_of_a_window_stands_out(lanes, site):
    before = walk(lanes, PRIOR, 60, 8)
    after = walk(lanes, PANNED, 60, 9, since_s=float(before[-1].time_s[-1]) + 20)
    window = observed([*before, *after])
    at = estimate_pose(window, site).fused.values
    paths = site.flow.site(LENS)
    walkers = walkers_of(window, at)
    found = moved_within(walkers, paths, at, site.flow.still, 1e-12)
    assert found is not None
    assert abs(found - 60) <= 5


def test_a_site_without_doors_is_as_if_nobody_had_looked_for_any(lanes):
    """All end at the border, or 22 m away, as far as the tracker follows: no landmark."""
    endless = [replace(lane, doors_m=(-math.inf, math.inf)) for lane in lanes]
    near = replace(CONFIG, farthest_m=22.0)
    rng = np.random.default_rng(10)
    seen = observed(walk_site(LENS, PRIOR, endless, near, 150, rng))
    assert seen.moments is not None
    assert seen.moments.events > 50
    assert fold_maps(seen, LENS, AT, 0).grains.doors is None
    learned, bare = (
        learn_flow(tracks, LENS, PRIOR, 0) for tracks in (seen, replace(seen, moments=None))
    )
    assert flow_to_bytes(learned) == flow_to_bytes(bare)


def test_bytes_keep_doors_to_the_bit(site):
    data = flow_to_bytes(site.flow)
    back = flow_from_bytes(data)
    assert flow_to_bytes(back) == data
    for name in ("corner", "cell_m", "ratio", "known", "log_size", "rate", "weight"):
        assert_array_equal(getattr(back.doors, name), getattr(site.flow.doors, name))
    assert len(data) < 1_000_000
