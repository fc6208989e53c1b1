"""An estimate that begins where the last one ended comes to the same as one of all poses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.errors import CheckpointError
from models.geometry.pose import PARAMETERS, CameraPose
from models.pose import (
    config,
    estimate_pose,
    learn_site,
    observe,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.observations import of_tracks
from models.tracks.trajectory import by_end
from studies.recordings import load_recording
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.conftest import SCENES
from tests.models.sites import LENS, PRIOR

LONG = SCENES.parent / "long"
CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)
WINDOW, STEP = 160, 10
SAME = 0.05  # of a standard deviation
SMALL = PoseOffset(tilt_rad=math.radians(1), heading_rad=math.radians(-1))
LARGE = PoseOffset(
    tilt_rad=math.radians(3),
    roll_rad=math.radians(-2),
    heading_rad=math.radians(-5),
    log_height=0.08,
)
# The knock, and after which share of the tracks it came; before all of them, if that is None.
KNOCKS = {
    "still": (None, None),
    "far": (LARGE, None),
    "a little in mid-window": (SMALL, 0.8),
}


def knocked(tracks, lens, pose, knock, share=None):
    """Tracks as a camera sees them that was knocked; before some share of them, if it is given."""
    if knock is None:
        return list(tracks)
    first = 0 if share is None else int(share * len(tracks))
    moved = [offset_trajectory(track, lens, pose, knock.apply(pose)) for track in tracks[first:]]
    return by_end([*tracks[:first], *(track for track in moved if track and track.long_enough)])


def follow(every, site, window=WINDOW, step=STEP):
    """Looks at the newest tracks: all poses tried, begun at the last, and whether it sufficed."""
    last, since = None, 0
    for came in range(window, every.tracks + 1, step):
        since = max(since, came - window)
        tracks = of_tracks(every, np.arange(since, came))
        full, found = estimate_pose(tracks, site), estimate_pose(tracks, site, warm_start=last)
        refined = (
            found.warm_start is not None and found.warm_start.search.to_s < tracks.ended_s.max()
        )
        yield full, found, refined
        last, since = found.warm_start, since + full.first


def apart(full, found):
    """How far two findings are apart in standard deviations: poses, and their own deviations."""
    assert found.change_idx == full.change_idx
    assert found.fused.identifiable == full.fused.identifiable
    assert found.fused.registered == full.fused.registered
    names = full.fused.identifiable
    at = [PARAMETERS.index(name) for name in names]
    sd, by_sd = (np.sqrt(np.diag(each.fused.covariance))[at] for each in (full, found))
    off = np.abs(found.fused.values - full.fused.values)[at] / sd
    return max([0.0, *off, *np.abs(by_sd / sd - 1)])


@pytest.fixture(scope="module")
def lanes():
    return draw_lanes(LENS, PRIOR, CONFIG, np.random.default_rng(3))


@pytest.fixture(scope="module")
def site(lanes):
    known = walk_site(LENS, PRIOR, lanes, CONFIG, 150, np.random.default_rng(4))
    return learn_site(observe(by_end(known), LENS, PRIOR), LENS, PRIOR, chart=False)


@pytest.fixture(scope="module")
def people(lanes):
    return by_end(walk_site(LENS, PRIOR, lanes, CONFIG, 250, np.random.default_rng(5)))


@pytest.mark.parametrize("knock", [None, LARGE])
def test_a_few_new_tracks_refine_the_last_pose_and_come_to_the_same(site, people, knock):
    every = observe(knocked(people[:200], LENS, PRIOR, knock), LENS, PRIOR)
    looks = list(follow(every, site))
    assert sum(refined for _, _, refined in looks) >= len(looks) - 2
    assert max(apart(full, found) for full, found, _ in looks) < SAME


def test_a_knock_in_mid_window_is_found_as_soon(site, people):
    every = observe(knocked(people, LENS, PRIOR, LARGE, 0.8), LENS, PRIOR)
    looks = list(follow(every, site))
    assert any(full.change_idx is not None for full, _, _ in looks)
    assert max(apart(full, found) for full, found, _ in looks) < SAME


def test_where_there_is_any_doubt_all_poses_are_tried(site, people):
    def came(tracks, last):
        found = estimate_pose(tracks, site, warm_start=last)
        return found.warm_start is None or found.warm_start.search.to_s == tracks.ended_s.max()

    every = observe(people, LENS, PRIOR)
    first = of_tracks(every, np.arange(WINDOW))
    last = estimate_pose(first, site).warm_start
    near = of_tracks(every, np.arange(10, WINDOW + 10))
    assert not came(near, last)
    assert came(near, None)
    assert came(near, replace(last, prior=CameraPose(height_m=6.1, tilt_rad=0.3, roll_rad=0.0)))
    better = replace(last.search, path_fit=last.search.path_fit + 1)
    assert came(near, replace(last, search=better))  # it fits worse
    assert came(of_tracks(every, np.arange(85, 250)), last)  # more than half is new
    assert came(of_tracks(every, np.arange(60, WINDOW + 10)), last)  # the window was cut
    late = replace(near, ended_s=np.where(np.arange(WINDOW) % 3, near.ended_s - 0.1, near.ended_s))
    assert came(late, last)  # two thirds of it are of other tracks, though none is newer
    elsewhere = replace(last.fused, values=last.fused.values + [0.0, 0.02, 0.0, 0.0])
    assert came(near, replace(last, fused=elsewhere))  # it has moved by more than chance
    assert came(near, replace(last, registered=False))  # by a site without a map
    assert came(near, replace(last, reason_code="flow_changed"))


def test_a_warm_start_that_was_stored_is_the_same_start(site, people):
    every = observe(people, LENS, PRIOR)
    last = estimate_pose(of_tracks(every, np.arange(WINDOW)), site).warm_start
    data = warm_start_to_bytes(last)
    assert len(data) < 8000
    stored = warm_start_from_bytes(data)
    assert warm_start_to_bytes(stored) == data
    near = of_tracks(every, np.arange(10, WINDOW + 10))
    first, second = (estimate_pose(near, site, warm_start=begin) for begin in (last, stored))
    assert second.pose == first.pose
    assert second.warm_start.search.to_s == last.search.to_s  # no other poses were tried
    with pytest.raises(CheckpointError, match="warm_start"):
        warm_start_from_bytes(data[:-9])


@pytest.mark.skipif(not SCENES.is_dir(), reason="recorded scenes are not at hand")
@pytest.mark.parametrize("knock", [None, LARGE])
def test_recorded_people_come_to_the_same(monkeypatch, knock):
    """The scene with the most people: as many as a window is refined with are in none of them."""
    monkeypatch.setattr(config, "WARM_TRACKS", 100)
    scene = load_recording(SCENES / "wildtrack_c6")[0]
    tracks = by_end(track.trajectory for track in scene.tracks if track.trajectory.long_enough)
    lens, pose, half = scene.intrinsics, scene.true_pose, len(tracks) // 2
    site = learn_site(observe(tracks[:half], lens, pose), lens, pose, chart=False)
    every = observe(knocked(tracks[half:], lens, pose, knock), lens, pose)
    looks = list(follow(of_tracks(every, np.arange(120)), site, 108, 6))
    assert any(refined for _, _, refined in looks)
    assert max(apart(full, found) for full, found, _ in looks) < SAME


@pytest.fixture(scope="module", params=["atc_20121024", "lincoln_corridor"])
def crowd(request):
    """Real people before a virtual camera: its site, learned of a thousand of them, and others."""
    scene = load_recording(LONG / request.param)[0]
    tracks = by_end(track.trajectory for track in scene.tracks if track.trajectory.long_enough)
    lens, pose = scene.intrinsics, scene.true_pose
    site = learn_site(observe(tracks[:1000], lens, pose), lens, pose, chart=False)
    return lens, pose, site, tracks[1000:1700]


# The likelihood of a map of real people has small peaks side by side, and a search that begins
# elsewhere may end at another of these; neither is better. The recorded scenes have fewer people
# than a window is refined with: theirs are always searched.
@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.skipif(not LONG.is_dir(), reason="long recordings are not at hand")
@pytest.mark.parametrize("knock", KNOCKS)
def test_real_people_come_to_the_same(crowd, knock):
    lens, pose, site, tracks = crowd
    every = observe(knocked(tracks, lens, pose, *KNOCKS[knock]), lens, pose)
    looks = list(follow(every, site, 400, 25))
    if KNOCKS[knock][1] is None:
        # Where people walk elsewhere than an hour ago all poses are looked at, as they should be.
        calm = [refined for full, _, refined in looks if full.warm_start is not None]
        assert calm
        assert sum(calm) >= len(calm) // 3
    far = [apart(full, found) for full, found, refined in looks if refined]
    assert max(far, default=0.0) < 0.4
    assert np.median([apart(full, found) for full, found, _ in looks]) < SAME
