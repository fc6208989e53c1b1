"""A window whose new tracks were scored alone has the chart of the whole window."""

from dataclasses import replace

import numpy as np
import pytest

from models.assessment import (
    AssessmentLimits,
    ScoredTracks,
    TrackWindow,
    WindowContext,
    chart_basis,
    chart_of_scored,
    context_from_bytes,
    context_to_bytes,
    monitor,
    score_part,
    scored_from_bytes,
    scored_to_bytes,
    scored_window,
    tail_of,
)
from models.pose import learn_site, linked, observe
from models.rows import rows_of
from models.tracks.scenes import load_scene
from models.tracks.trajectory import end_key
from studies.protocol.partings import first_seen
from tests.conftest import SCENES
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

LIMITS = AssessmentLimits()
EXACT = 1e-12
FOLDERS = sorted(each.parent for each in SCENES.glob("wildtrack_*/camera.json"))


class Replay:
    """A window of tracks that are scored a few at a time, after its first ones as a whole."""

    def __init__(self, site, tracks, first):
        self.site, self.tracks, self.basis = site, tracks, chart_basis(site)
        self.count = first
        self.begin()

    def whole(self):
        seen = self.tracks[: self.count]
        links = linked(seen, self.site.intrinsics, self.site.prior)
        found = monitor(TrackWindow(trajectories=seen, before=links.before), self.site, LIMITS)
        return found, links.scale

    def begin(self):
        """Score the whole window, as a full estimate does."""
        found, scale = self.whole()
        self.context = WindowContext(links=scale, scores=found.scores.context)
        self.scored = scored_window(found, np.arange(self.count))

    def add(self, number):
        """Score some new tracks alone; returns how many tracks were scored."""
        new = np.arange(self.count, self.count + number)
        tail = tail_of(self.scored, min(self.tracks[n].time_s[0] for n in new))
        keys = np.concatenate([tail, new])
        part = score_part(keys, [self.tracks[n] for n in keys], self.basis, self.context)
        self.scored = self.scored.merged(part)
        self.count += number
        return keys.size

    @property
    def chart(self):
        return chart_of_scored(self.scored, self.basis, LIMITS)

    def at_once(self):
        """The whole window, scored by the context of its first tracks."""
        keys = np.arange(self.count)
        return score_part(keys, self.tracks[: self.count], self.basis, self.context)


@pytest.fixture(scope="module")
def street():
    """A learned site, tracks of its camera in place, and tracks after a knock."""
    views = tracks_of(3, (PRIOR, 200), (PRIOR, 160), (KNOCKED, 60))
    known, still, moved = (sorted(each, key=end_key) for each in views)
    site = learn_site(observe(known, LENS, PRIOR), LENS, PRIOR)
    assert site.chart is not None
    return site, still, moved


def assert_same(chart, other):
    assert (chart.parameter, chart.sign) == (other.parameter, other.sign)
    assert (chart.walking_groups, chart.track_idx) == (other.walking_groups, other.track_idx)
    assert chart.statistic == pytest.approx(other.statistic, rel=EXACT)
    assert chart.level == pytest.approx(other.level, rel=EXACT)


def assert_same_scores(scored, other):
    for name in ("key", "walk", "group", "started_s", "ended_s"):
        np.testing.assert_array_equal(getattr(scored, name), getattr(other, name))
    np.testing.assert_allclose(scored.values, other.values, rtol=EXACT, atol=EXACT)


def test_chart_of_whole_window_is_that_of_its_scored_tracks(street):
    site, still, _ = street
    replay = Replay(site, still, 120)
    assert_same(replay.chart, replay.whole()[0].chart)


@pytest.mark.parametrize("number", [1, 5, 10])
def test_new_tracks_scored_alone_give_the_chart_of_the_whole_window(street, number):
    site, still, moved = street
    replay = Replay(site, still + moved, 120)
    scored = 0
    for _ in range(100 // number):
        scored += replay.add(number)
    assert replay.count == 220
    assert scored < 100 * 8  # and not 100 / number times the window
    assert_same_scores(replay.scored, replay.at_once())
    whole, chart = replay.whole()[0].chart, replay.chart
    assert chart.moved
    assert whole.moved
    # Busyness of unseen ground is that of the first 120 tracks: the whole window has another.
    assert chart.statistic == pytest.approx(whole.statistic, rel=0.1)
    replay.begin()
    assert_same(replay.chart, whole)  # a full estimate ends the difference


def test_pieces_of_one_walk_in_two_runs_are_one_walk(street):
    site, still, _ = street
    walk = still[130]
    half = walk.time_s.size // 2
    cut = [walk.part(np.arange(half)), walk.part(np.arange(half, walk.time_s.size))]
    tracks = sorted([*still[:130], *cut], key=end_key)
    first = next(n for n, track in enumerate(tracks) if track is cut[0])
    replay = Replay(site, tracks, first + 1)
    while replay.count < len(tracks):
        replay.add(1)
    assert replay.scored.walks == 131
    assert_same_scores(replay.scored, replay.at_once())


def test_newest_tracks_are_of_so_many_walks(street):
    site, still, _ = street
    scored = Replay(site, still, 120).scored
    assert scored.newest(100, 0.0).key.tolist() == list(range(20, 120))
    pieces = replace(scored, walk=np.where(scored.key == 60, 61, scored.walk))
    assert pieces.newest(100, 0.0).key.tolist() == list(range(19, 120))
    assert scored.newest(400, float(scored.ended_s[50])).key.tolist() == list(range(50, 120))


def test_scored_tracks_survive_the_store(street):
    site, still, _ = street
    replay = Replay(site, still, 60)
    assert_same_scores(scored_from_bytes(scored_to_bytes(replay.scored)), replay.scored)
    kept = context_from_bytes(context_to_bytes(replay.context))
    assert kept.links == replay.context.links
    assert kept.scores.origin_s == replay.context.scores.origin_s
    np.testing.assert_array_equal(kept.scores.busyness, replay.context.scores.busyness)
    assert scored_from_bytes(b"").key.size == 0
    assert isinstance(rows_of(replay.scored, np.arange(3)), ScoredTracks)


@pytest.mark.slow
@pytest.mark.skipif(not FOLDERS, reason=f"no recorded scenes in {SCENES}")
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_recorded_tracks_scored_alone_give_the_chart_of_the_whole_window(folder):
    scene = load_scene(folder)
    people = sorted(scene.tracks, key=lambda track: end_key(track.trajectory))
    half = len(people) // 2
    known, later = (
        [each.trajectory for each in first_seen(scene, some, scene.true_pose, None)]
        for some in (people[:half], people[half:])
    )
    lens, pose = scene.intrinsics, scene.true_pose
    site = learn_site(observe(known, lens, pose), lens, pose)
    replay = Replay(site, later, len(later) // 2)
    charts = exact = 0
    while replay.count + 5 <= len(later):
        replay.add(5)
        whole, chart = replay.at_once(), replay.chart
        other = chart_of_scored(whole, replay.basis, LIMITS)
        charts += 1
        straddles = (whole.group != replay.scored.group) | (whole.walk != replay.scored.walk)
        exact += bool(chart.statistic == pytest.approx(other.statistic, rel=EXACT))
        assert straddles.any() or chart.statistic == pytest.approx(other.statistic, rel=EXACT)
        assert chart.statistic == pytest.approx(other.statistic, abs=0.1 * chart.level)
        fresh = replay.whole()[0].chart
        assert chart.statistic == pytest.approx(fresh.statistic, abs=0.25 * chart.level)
        if replay.count % 10 == 0:
            replay.begin()
    assert exact >= 0.9 * charts
