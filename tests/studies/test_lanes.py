"""The simulated site keeps to what it is told."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.pose import CameraPose
from models.geometry.upright import statures
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

QUIET = SiteConfig(
    noise_px=0.0, standing_share=0.0, within_sd=0.0, between_sd=0.1, aside_m=0.0, stature_sd=0.03
)


def on_ground(tracks, pose=PRIOR):
    return [ground_from_pixel(LENS, pose.rotation, pose.centre_m, track.uv)[0] for track in tracks]


def test_speeds_and_statures_are_those_asked_for():
    (tracks,) = tracks_of(0, (PRIOR, 300), config=QUIET, boxes=True)
    speeds, heights = [], []
    for track, ground in zip(tracks, on_ground(tracks), strict=True):
        length = np.linalg.norm(ground[-1] - ground[0])
        speeds.append(length / (track.time_s[-1] - track.time_s[0]))
        tall, valid = statures(LENS, PRIOR.rotation, PRIOR.height_m, track.uv, track.top_v)
        heights += list(tall[valid][:1])
    assert_allclose(np.exp(np.mean(np.log(speeds))), 1.3, rtol=0.02)
    assert_allclose(np.std(np.log(speeds)), 0.1, rtol=0.15)
    assert_allclose(np.exp(np.mean(np.log(heights))), 1.72, rtol=0.01)
    assert_allclose(np.std(np.log(heights)), 0.03, rtol=0.15)


def test_both_poses_see_the_same_lanes():
    before, after = tracks_of(1, (PRIOR, 30), (KNOCKED, 30), config=QUIET)
    lanes = draw_lanes(LENS, PRIOR, QUIET, np.random.default_rng(1))
    for tracks, pose in ((before, PRIOR), (after, KNOCKED)):
        for number, ground in enumerate(on_ground(tracks, pose)):
            aside = [
                abs((ground[0] - lane.point) @ [-lane.direction[1], lane.direction[0]])
                for lane in lanes
            ]
            assert min(aside) < 1e-6, number


def test_some_stand_and_noise_is_what_it_is_said_to_be():
    (tracks,) = tracks_of(
        2, (PRIOR, 200), config=SiteConfig(standing_share=1.0, noise_px=2.0)
    )  # fmt: skip
    spread = [np.std(track.uv, axis=0) for track in tracks if len(track.uv) == 40]
    # 2 px of the tracker and what 5 cm of sway are in the picture.
    assert 2 < np.median(spread) < 4


def test_the_seed_alone_makes_the_site():
    first, again = (tracks_of(7, (PRIOR, 5))[0] for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert_array_equal(one.uv, other.uv)


def test_a_camera_that_sees_no_ground_is_refused():
    up = CameraPose(height_m=6, tilt_rad=math.radians(-40), roll_rad=0)
    with pytest.raises(DegenerateGeometryError, match="no ground within 45 m"):
        draw_lanes(LENS, up, SiteConfig(), np.random.default_rng(0))
    lanes = draw_lanes(LENS, PRIOR, SiteConfig(), np.random.default_rng(0))
    with pytest.raises(DegenerateGeometryError, match="0 of 3 walks"):
        walk_site(LENS, up, lanes, SiteConfig(), 3, np.random.default_rng(0))
