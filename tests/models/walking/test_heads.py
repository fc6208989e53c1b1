"""Tilt and roll by heads: knocks are told and covered, heads that nobody measured noticed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.pose import estimate_pose, learn_site, observe
from models.quantiles import Z90
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.trajectory import by_end
from models.tracks.walks import observe_heads
from models.walking.heads import HeadEstimate, head_estimate, joined, learn_heads
from models.walking.speed_reference import reference_from_bytes, reference_to_bytes
from studies.simulation.heads import HeadConfig, with_box_heads, with_heads
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

AT = np.array([PRIOR.tilt_rad, PRIOR.roll_rad])
MOVED = np.array([KNOCKED.tilt_rad, KNOCKED.roll_rad])
LEANING = HeadConfig(forward_rad=math.radians(3), bias_rad=math.radians(1.5))


def headed(seed, *views, config=LEANING):
    """HeadFootPairs of simulated people, as many as each pose sees."""
    rng = np.random.default_rng(seed)
    found = tracks_of(seed, *views, boxes=True)
    return [
        observe_heads(with_heads(tracks, LENS, pose, config, rng), LENS)
        for tracks, (pose, _) in zip(found, views, strict=True)
    ]


def columns(seed, *views):
    """The same with heads right above the feet in the picture."""
    found = tracks_of(seed, *views, boxes=True)
    return [observe_heads(with_box_heads(tracks), LENS) for tracks in found]


@pytest.fixture(scope="module")
def seen():
    return headed(1, (PRIOR, 120), (KNOCKED, 60), (PRIOR, 40))


@pytest.fixture(scope="module")
def reference(seen):
    return learn_heads(seen[0], AT)


def test_a_reference_knows_how_people_and_their_detector_lean(reference):
    assert reference.leaning
    assert abs(reference.column_share) < 0.05
    bias, forward = np.degrees(reference.habit.mean)
    assert bias == pytest.approx(1.5, abs=0.4)
    assert forward == pytest.approx(3.0, abs=0.6)
    assert np.degrees(reference.components.between_sd) == pytest.approx(1.0, abs=0.4)
    assert 1 <= reference.variance_inflation < 3
    assert reference.tracks == pytest.approx(120, abs=3)


def test_upright_people_without_noise_tell_the_pose_itself():
    ideal = HeadConfig(jitter=0.0, person_sd_rad=0.0)
    known, after = headed(2, (PRIOR, 40), (KNOCKED, 20), config=ideal)
    found = head_estimate(after, learn_heads(known, AT))
    assert_allclose(np.degrees(found.values), np.degrees(MOVED), atol=0.02)


@pytest.mark.nightly
def test_knocks_are_told_and_intervals_cover_them():
    errors = []
    for seed in range(5):
        known, after = headed(seed, (PRIOR, 100), (KNOCKED, 50))
        found = head_estimate(after, learn_heads(known, AT))
        assert found.identifiable
        errors.append((found.values - MOVED) / np.sqrt(np.diag(found.covariance)))
        assert np.abs(np.degrees(found.values - MOVED)).max() < 1.2
    assert (np.abs(errors) < Z90).mean() >= 0.7


def test_heads_right_above_feet_are_noticed_and_not_used():
    known, after = columns(3, (PRIOR, 120), (KNOCKED, 40))
    reference = learn_heads(known, AT)
    assert reference.column_share == pytest.approx(1.0, abs=0.05)
    assert not reference.leaning
    assert head_estimate(after, reference) is None


def test_a_tracker_that_begins_to_make_its_heads_up_is_noticed_in_the_window(reference):
    (after,) = columns(1, (KNOCKED, 60))
    found = head_estimate(after, reference)
    assert not found.identifiable
    assert found.column_share > 0.4 or found.values[0] < math.radians(3)


def test_few_heads_tell_nothing(reference, seen):
    assert learn_heads(seen[0].of_tracks(np.arange(11)), AT) is None
    assert learn_heads(None, AT) is None
    assert head_estimate(seen[1].of_tracks(np.arange(4)), reference) is None
    assert head_estimate(None, reference) is None
    assert head_estimate(seen[1], None) is None


def test_what_was_learned_is_stored_with_the_site_and_sites_without_it_are_read(reference):
    known = [replace(track, top_v=None) for track in tracks_of(4, (PRIOR, 60))[0]]
    site = learn_site(observe(by_end(known), LENS, PRIOR), LENS, PRIOR, chart=False)
    bare = site.speed_reference
    assert bare.heads is None
    assert reference_from_bytes(reference_to_bytes(bare)).heads is None
    read = reference_from_bytes(reference_to_bytes(replace(bare, heads=reference))).heads
    assert_allclose(read.habit.mean, reference.habit.mean)
    assert read.leaning == reference.leaning
    assert reference_to_bytes(replace(bare, heads=read)) == reference_to_bytes(
        replace(bare, heads=reference)
    )


def told(values_deg, sd_deg):
    return HeadEstimate(
        values=np.radians(values_deg),
        covariance=np.diag(np.radians(sd_deg) ** 2),
        column_share=0.0,
        identifiable=True,
        tracks=50,
    )


def test_two_that_agree_are_surer_and_two_that_do_not_are_less_sure():
    values = np.array([*np.radians([20.0, 0.0]), 1.8])
    covariance = np.diag([*np.radians([1.0, 1.0]) ** 2, 0.01])
    covariance[0, 2] = covariance[2, 0] = 0.5 * math.radians(1.0) * 0.1
    both, sure = joined(values, covariance, told([21.0, 0.0], np.array([1.0, 1.0])))
    # Halfway between, by 1 / sqrt 2; the height follows the tilt by 0.5 * 0.1 a degree.
    assert_allclose(np.degrees(both[:2]), [20.5, 0.0], atol=1e-9)
    assert_allclose(np.degrees(np.sqrt(sure[0, 0])), math.sqrt(0.5))
    assert_allclose(both[2], 1.8 + 0.5 * 0.05)
    # 8 deg apart in tilt: 64 / 2 over 2 is a ratio of 16, and it is the tilt alone that is unsure.
    both, unsure = joined(values, covariance, told([28.0, 0.0], np.array([1.0, 1.0])))
    assert_allclose(np.degrees(np.sqrt(unsure[0, 0])), 4 * math.sqrt(0.5))
    assert_allclose(np.degrees(np.sqrt(unsure[1, 1])), math.sqrt(0.5))


@pytest.mark.nightly
def test_the_served_pose_wins_by_heads_and_loses_nothing_by_made_up_ones():
    known, after = tracks_of(5, (PRIOR, 100), (KNOCKED, 40), boxes=True)
    rng = np.random.default_rng(5)

    def served(as_headed):
        parts = (as_headed(known, PRIOR), as_headed(after, KNOCKED))
        first, last = (by_end(replace(track, top_v=None) for track in part) for part in parts)
        site = learn_site(observe(first, LENS, PRIOR), LENS, PRIOR, chart=False)
        return estimate_pose(observe(last, LENS, PRIOR), site)

    feet = served(lambda tracks, pose: tracks)
    heads = served(lambda tracks, pose: with_heads(tracks, LENS, pose, LEANING, rng))
    made_up = served(lambda tracks, pose: with_box_heads(tracks))
    assert feet.joint.heads is made_up.joint.heads is None
    assert_allclose(made_up.fused.values, feet.fused.values)
    assert heads.joint.heads is not None
    assert np.abs(np.degrees(heads.fused.values[:2] - MOVED)).max() < 0.6
    # Of strangers only their uprightness is believed.
    values, covariance = heads.joint.beside_strangers()
    assert np.degrees(np.sqrt(covariance[1, 1])) < 0.6
    assert np.abs(np.degrees(values[:2] - MOVED)).max() < 1.2


def test_heads_go_with_their_people_when_the_camera_is_knocked():
    (tracks,) = tracks_of(6, (PRIOR, 5), boxes=True)
    rng = np.random.default_rng(6)
    (track, *_) = with_heads(tracks, LENS, PRIOR, LEANING, rng)
    moved = PoseOffset(tilt_rad=0.05, roll_rad=0.04, heading_rad=0.1).apply(PRIOR)
    seen = offset_trajectory(track, LENS, PRIOR, moved)
    back = offset_trajectory(seen, LENS, moved, PRIOR)
    kept = np.isin(track.time_s, back.time_s)
    known = np.isfinite(back.head_uv[:, 0])
    assert known.sum() > 3
    assert_allclose(back.head_uv[known], track.head_uv[kept][known], atol=1e-6)
    assert np.abs(seen.head_uv[0] - track.head_uv[0]).max() > 10
