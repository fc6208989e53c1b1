"""What is read of tracks: runs without a gap, nodes smoothed by straight lines, steps between."""

from dataclasses import replace

import numpy as np
import pytest

from models.tracks import config
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_each
from studies.simulation.lanes import SiteConfig
from tests.models.sites import LENS, PRIOR, seen, tracks_of


def straight(time_s, *, top_v=None):
    """Someone who goes 30 px to the right a second, 20 px down."""
    time_s = np.asarray(time_s, dtype=np.float64)
    uv = np.array([400.0, 300.0]) + np.outer(time_s, [30.0, 20.0])
    return Trajectory(time_s=time_s, uv=uv, top_v=top_v)


def nodes_of(seen_):
    """Normalised x, y of where steps begin."""
    return seen_.steps.start_rays[:, :2]


def test_nodes_are_the_values_of_weighted_straight_lines():
    """Against the normal equations of each node by themselves."""
    time_s = np.arange(0.0, 4.61, 0.2)
    rng = np.random.default_rng(0)
    clean = straight(time_s)
    uv = clean.uv + rng.normal(0, 1.0, clean.uv.shape)
    tops = uv[:, 1] - 120.0
    found = observe_each([Trajectory(time_s=time_s, uv=uv, top_v=tops)], LENS).tops
    nodes_s = (4.6 - 4.5) / 2 + 1.5 * np.arange(4)
    for node_s, ray in zip(nodes_s, found.foot_rays, strict=True):
        weight = np.clip(1 - np.abs(time_s - node_s) / 0.7, 0, None)
        ahead = np.column_stack([np.ones(time_s.size), time_s - node_s])
        line = np.linalg.solve(
            ahead.T @ (weight[:, None] * ahead), ahead.T @ (weight[:, None] * uv)
        )
        wanted = (line[0] - [LENS.cx, LENS.cy]) / [LENS.fx, LENS.fy]
        np.testing.assert_allclose(ray[:2], wanted, atol=1e-9)
    np.testing.assert_allclose(found.foot_rays[:, 1] - found.top_y, 120.0 / LENS.fy)


def test_a_step_lies_along_the_line_and_has_no_noise_where_there_is_none():
    found = observe_each([straight(np.arange(0.0, 9.1, 0.5))], LENS).steps
    way = found.end_rays - found.start_rays
    np.testing.assert_allclose(way[:, 1] / way[:, 0], 20 / 30)
    np.testing.assert_allclose(way[:, 0], 1.5 * 30 / LENS.fx)
    np.testing.assert_allclose(found.noisy_end_rays, found.end_rays, atol=1e-9)
    np.testing.assert_allclose(found.seconds, 1.5)
    assert found.rows.linked.tolist() == [False, *[True] * 5]


def test_a_gap_and_the_edge_of_the_picture_part_a_track():
    whole = straight(np.arange(0.0, 12.1, 0.4))
    cut = whole.part(np.flatnonzero((whole.time_s < 4.9) | (whole.time_s > 7.0)))
    assert observe_each([whole], LENS).steps.rows.linked.sum() == 7
    assert observe_each([cut], LENS).steps.rows.linked.tolist() == [
        False,
        True,
        True,
        False,
        True,
        True,
    ]
    beyond = straight(np.arange(0.0, 40.1, 0.4))  # leaves the picture after 21 s
    found = observe_each([beyond], LENS).steps.rows
    assert 18 < found.time_s[-1] < 21
    assert found.owner_idx.tolist() == [0] * found.owner_idx.size


@pytest.mark.parametrize("days", [1 / 24, 30.0, 7300.0])
def test_points_far_apart_are_no_run_however_far_they_always_are(days):
    """Six points over a month were one run, with a node each 1.5 s: 1.7 million."""
    sparse = Trajectory(
        time_s=1e9 + np.linspace(0, 86_400 * days, 6), uv=straight(np.arange(6.0)).uv
    )
    assert not len(observe_each([sparse], LENS).steps.rows)
    near = Trajectory(time_s=1e9 + np.linspace(0, 50.0, 6), uv=sparse.uv)  # 10 s apart
    assert len(observe_each([near], LENS).steps.rows) == 33


def test_a_track_has_no_more_nodes_than_an_hour_has():
    time_s = np.arange(0.0, 5_000.1, 1.0)
    goes_on = Trajectory(time_s=time_s, uv=np.full((time_s.size, 2), 400.0))
    cut = goes_on.part(np.flatnonzero(time_s % 100))  # 50 runs, each of 65 nodes at most
    beside = straight(np.arange(0.0, 9.1, 0.5))
    for track in (goes_on, cut):
        rows = observe_each([track, beside, track], LENS).steps.rows
        steps = np.bincount(rows.owner_idx)
        assert steps[1] == 6
        assert steps[0] == steps[2]
        assert 0.9 * config.MOST_NODES < steps[0] < config.MOST_NODES


def test_feet_that_a_box_has_lost_below_the_picture_are_not_where_it_ends():
    time_s = np.arange(0.0, 30.1, 0.4)
    goes = Trajectory(time_s=time_s, uv=np.column_stack([400 + 0 * time_s, 300 + 20 * time_s]))
    in_view = goes.part(np.flatnonzero(goes.uv[:, 1] < 717))  # two pixels and a half above 719.5
    stays = np.minimum(goes.uv, [np.inf, 719.0])  # from 21 s on the box ends with the picture
    cut = observe_each([replace(goes, uv=stays)], LENS).steps
    for field in ("start_rays", "end_rays", "seconds"):
        np.testing.assert_array_equal(
            getattr(cut, field), getattr(observe_each([in_view], LENS).steps, field)
        )
    assert len(cut.rows) == 13


def test_boxes_are_smoothed_as_heights_and_may_be_missing():
    time_s = np.arange(0.0, 6.1, 0.4)
    tops = straight(time_s).uv[:, 1] - 100.0
    tops[:5] = np.nan
    some = observe_each([straight(time_s, top_v=tops), straight(time_s)], LENS).tops
    assert set(some.rows.owner_idx.tolist()) == {0}
    assert 0 < len(some.rows) < 5
    one = np.full(time_s.size, np.nan)
    one[8] = tops[8]
    assert not len(observe_each([straight(time_s, top_v=one)], LENS).tops.rows)


def test_tracks_are_read_the_same_alone_and_together():
    (tracks,) = tracks_of(4, (PRIOR, 30), config=SiteConfig(), boxes=True)
    together = seen(tracks)
    at = 0
    for number, track in enumerate(tracks):
        alone = seen([track])
        count = len(alone.steps.rows)
        here = slice(at, at + count)
        np.testing.assert_array_equal(together.steps.start_rays[here], alone.steps.start_rays)
        np.testing.assert_array_equal(together.steps.rows.linked[here], alone.steps.rows.linked)
        assert (together.steps.rows.owner_idx[here] == number).all()
        at += count
    assert at == len(together.steps.rows)
    nobody = observe_each([], LENS)
    assert (nobody.tracks, len(nobody.steps.rows), nobody.ended_s.size) == (0, 0, 0)


@pytest.mark.parametrize("boxes", [True, False])
def test_feet_that_are_hidden_for_a_second_are_left_out_and_the_walk_goes_on(boxes):
    time_s = np.arange(0.0, 20.1, 0.2)
    whole = straight(time_s, top_v=180 + 20 * time_s)
    high = (time_s > 7.1) & (time_s < 7.9)
    raised = replace(whole, uv=whole.uv - np.outer(high, [0.0, 50.0]))
    found, calm = (
        observe_each([each if boxes else replace(each, top_v=None)], LENS)
        for each in (raised, whole)
    )
    for field in ("start_rays", "end_rays", "seconds"):
        np.testing.assert_allclose(
            getattr(found.steps, field), getattr(calm.steps, field), atol=1e-9
        )
    assert found.steps.rows.linked.sum() == len(calm.steps.rows) - 1
    assert found.ended_s.tolist() == calm.ended_s.tolist()
    np.testing.assert_allclose(found.tops.foot_rays, calm.tops.foot_rays, atol=1e-9)
    for_long = (time_s > 7.1) & (time_s < 11.9)
    gone = replace(whole, uv=whole.uv - np.outer(for_long, [0.0, 50.0]))
    parted = observe_each([gone if boxes else replace(gone, top_v=None)], LENS).steps.rows
    assert parted.linked.sum() == len(parted) - 2
    assert not ((parted.time_s > 7.8) & (parted.time_s < 11.2)).any()
