"""The change point: found to the track, not found where there is none."""

import math

import numpy as np
import pytest

from models.pose.change_point import find_change
from models.pose.config import FEWEST_BESIDE
from models.simulation.poses import PoseOffset
from models.simulation.walkers import WalkConfig
from models.tracks.observations import of_tracks
from models.tracks.trajectory import by_end
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from tests.models.sites import KNOCKED, PRIOR, seen, tracks_of

SLIGHT = PoseOffset(tilt_rad=math.radians(1.5), roll_rad=0.0, log_height=0.0).apply(PRIOR)


@pytest.fixture(scope="module")
def known():
    (tracks,) = tracks_of(6, (PRIOR, 120))
    return learn_speed_reference(seen(tracks), PRIOR, WalkConfig(), 0)


def window(*views):
    """Tracks of the site that `known` was learned on, other people."""
    _, *found = tracks_of(6, (PRIOR, 120), *views)
    return seen(by_end(track for tracks in found for track in tracks))


@pytest.mark.parametrize("before", [15, 60, 100])
def test_a_knock_is_found_where_it_was(known, before):
    change = find_change(window((PRIOR, before), (KNOCKED, 120 - before)), PRIOR, known)
    assert change is not None
    assert abs(change.track_idx - before) <= 2
    assert change.excess > 1


def test_a_second_knock_is_a_change_between_two_poses_off_the_prior(known):
    change = find_change(window((KNOCKED, 50), (SLIGHT, 50)), PRIOR, known)
    assert change is not None
    assert abs(change.track_idx - 50) <= 2


@pytest.mark.parametrize("pose", [PRIOR, KNOCKED])
def test_a_still_camera_has_no_change(known, pose):
    assert find_change(window((pose, 150)), PRIOR, known) is None


@pytest.mark.parametrize("after", [SLIGHT, KNOCKED, PRIOR])
def test_a_look_from_the_pose_of_all_finds_the_same(known, after):
    tracks = window((PRIOR, 60), (after, 60))
    near = joint_estimate(tracks, PRIOR, known).warm_start
    assert find_change(tracks, PRIOR, known, near) == find_change(tracks, PRIOR, known)


def test_a_few_tracks_after_a_knock_are_too_few(known):
    tracks = window((PRIOR, 60), (KNOCKED, FEWEST_BESIDE))
    assert find_change(of_tracks(tracks, np.arange(60 + FEWEST_BESIDE // 4)), PRIOR, known) is None
    assert find_change(of_tracks(tracks, np.arange(2 * FEWEST_BESIDE - 1)), PRIOR, known) is None
