"""Where the fit begins: a made-up site whose speeds agree at one pose alone."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.pose import plane_parameters_of
from models.pose import learn_site, observe
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.observations import Rows
from models.tracks.trajectory import by_end
from models.walking.estimate import channels_of
from models.walking.field import Field, Learned
from models.walking.fit import (
    Channel,
    FitStart,
    corrected_covariance,
    fit_pose,
    noise_information,
    starts,
)
from models.walking.measures import Measured
from models.walking.mixed_model import VarianceComponents, Weights
from studies.recordings import load_recording
from tests.conftest import SCENES

CENTRE = np.array([math.radians(20), 0.0, math.log(6)])
STEP = math.radians(4)  # of the grid
USUAL = math.log(1.4)
TRACKS, STEPS = 12, 5
COMPONENTS = VarianceComponents(
    between_sd=0.1,
    trend_sd=0.05,
    within_sd=0.1,
    correlation=0.3,
    outlier_share=0.1,
    outlier_mean=-2.0,
    outlier_sd=0.8,
)


def site(truth, valid=lambda candidate: True, tracks=TRACKS):
    """Speeds that are all usual at the true pose; away from it, tracks disagree the more."""
    count = tracks * STEPS
    rows = Rows(
        owner_idx=np.repeat(np.arange(tracks), STEPS),
        linked=np.tile(np.arange(STEPS) > 0, tracks),
        time_s=np.arange(count, dtype=float),
        when=np.zeros(count),
        owners=tracks,
    )
    side = rows.owner_idx % 3 - 1.0

    def measure(*, candidate, sloped):
        apart = np.hypot(*(candidate - truth)[:2])
        seen = np.full(count, bool(valid(candidate)))
        value = USUAL + candidate[2] - truth[2] + 3 * apart * side
        return Measured(
            value=np.where(seen, value, 0.0),
            place=np.zeros((count, 2)),
            direction=np.tile([1.0, 0.0], (count, 1)),
            valid=seen,
            d_value=np.zeros((count, 3)),
            d_place=np.zeros((count, 2, 3)),
            d_direction=None,
            d_direction_noise=np.zeros((count, 3)),
            rows=rows,
        )

    field = Field(
        centres=np.empty((0, 2)),
        length_m=1.0,
        directional=False,
        prior_mean=np.array([USUAL]),
        prior_variance=np.ones(1),
    )
    learned = Learned(
        field=field,
        mean=np.array([USUAL]),
        covariance=np.eye(1),
        components=COMPONENTS,
        usual=USUAL,
    )
    return [Channel(measure=measure, learned=learned)]


@pytest.mark.parametrize(("tilts", "rolls"), [(3, -2), (-5, 5), (0, 0)])
def test_the_best_start_is_the_grids_pose_nearest_to_the_truth(tilts, rolls):
    node = CENTRE + [tilts * STEP, rolls * STEP, math.log(7.5 / 6)]
    best, *others = starts(site(node + [0.01, -0.01, 0.0]), CENTRE, 2)
    assert_allclose(best[:2], node[:2], atol=1e-12)
    # Off by 0.8 deg, a third of the tracks are 4 % too fast, and a third too slow.
    assert math.exp(best[2]) == pytest.approx(7.5, rel=0.05)
    assert len(others) == 2


def test_at_the_truth_itself_the_height_is_the_true_one():
    node = CENTRE + [2 * STEP, STEP, math.log(0.8)]
    assert_allclose(starts(site(node), CENTRE, 1)[0], node, atol=1e-12)


def test_starts_are_five_degrees_apart_and_the_centre_is_the_last():
    found = starts(site(CENTRE + [STEP, 0.0, 0.0]), CENTRE, 4)
    assert len(found) == 5
    assert_allclose(found[-1], CENTRE)
    for place, one in enumerate(found[:-1]):
        for other in found[:place]:
            assert np.abs((one - other)[:2]).max() > math.radians(5)


def test_no_start_is_where_people_would_be_above_the_horizon():
    def low_enough(candidate):
        return candidate[0] > CENTRE[0] + 1.5 * STEP

    *chosen, last = starts(site(CENTRE + [STEP, 0.0, 0.0], low_enough), CENTRE, 3)
    assert len(chosen) == 3
    assert all(low_enough(start) for start in chosen)
    assert_allclose(chosen[0][:2], CENTRE[:2] + [2 * STEP, 0.0])  # the nearest that is left
    assert_allclose(last, CENTRE)


def test_where_nothing_is_seen_there_is_the_centre():
    for channels in (site(CENTRE, tracks=0), site(CENTRE, valid=lambda candidate: False)):
        (only,) = starts(channels, CENTRE, 2)
        assert_allclose(only, CENTRE)


def test_every_channel_has_a_say():
    speeds, statures = (site(CENTRE + [0.0, roll, 0.0]) for roll in (STEP, -STEP))
    more = site(CENTRE - [0.0, STEP, 0.0], tracks=4 * TRACKS)
    rolls = [starts(some, CENTRE, 1)[0][1] for some in (speeds, speeds + statures, speeds + more)]
    assert rolls == pytest.approx([STEP, 0.0, -STEP])


@pytest.mark.skipif(not SCENES.is_dir(), reason="recorded scenes are not at hand")
def test_wherever_it_begins_a_fit_arrives():
    """With a fixed share of each move one of these was 40 sd away when its rounds were over."""
    scene = load_recording(SCENES / "wildtrack_c6")[0]
    tracks = by_end(track.trajectory for track in scene.tracks if track.trajectory.long_enough)
    lens, pose, half = scene.intrinsics, scene.true_pose, len(tracks) // 2
    reference = learn_site(observe(tracks[:half], lens, pose), lens, pose, chart=False)
    knock = PoseOffset(tilt_rad=0.05, roll_rad=-0.035, heading_rad=-0.09, log_height=0.08)
    moved = [offset_trajectory(track, lens, pose, knock.apply(pose)) for track in tracks[half:]]
    seen = observe(by_end(track for track in moved if track and track.long_enough), lens, pose)
    channels = channels_of(seen, reference.speed_reference, pose)
    centre = plane_parameters_of(pose)
    ends = [
        fit_pose(channels, FitStart(candidate=centre + offset), pose)
        for offset in ([0.0, 0.0, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0])
    ]
    sd = np.sqrt(np.diag(ends[0].covariance))
    for end in ends[1:]:
        assert_allclose(end.candidate, ends[0].candidate, atol=0.2 * sd.min())


UNCORRELATED = VarianceComponents(
    between_sd=0.2,
    trend_sd=0.1,
    within_sd=0.1,
    correlation=0.0,
    outlier_share=0.1,
    outlier_mean=-2.0,
    outlier_sd=0.8,
)
MATRIX = np.array([[9.0, 2.0, 1.0], [2.0, 6.0, -1.0], [1.0, -1.0, 4.0]])


def measured_of(lengths, d_direction_noise, valid=None):
    count = sum(lengths)
    rows = Rows(
        owner_idx=np.repeat(np.arange(len(lengths)), lengths),
        linked=np.zeros(count, dtype=bool),
        time_s=np.arange(count, dtype=float),
        when=np.zeros(count),
        owners=len(lengths),
    )
    return Measured(
        value=np.zeros(count),
        place=np.zeros((count, 2)),
        direction=None,
        valid=np.ones(count, dtype=bool) if valid is None else np.array(valid),
        d_value=np.ones((count, 3)),
        d_place=np.zeros((count, 2, 3)),
        d_direction=None,
        d_direction_noise=np.array(d_direction_noise, dtype=float),
        rows=rows,
    )


def weights_of(measured, row=1.0):
    rows = measured.rows
    return Weights(
        row=np.full(len(rows), row),
        track=np.ones(rows.owners),
        inlier=np.ones(len(rows)),
        effects=np.zeros((rows.owners, 2)),
        effect_covariance=np.zeros((rows.owners, 2, 2)),
    )


def test_a_tracks_own_level_and_trend_take_two_of_its_rows():
    measured = measured_of([4], [[0.1, -0.2, 0.0]] * 4)
    # 4 rows of which 2 are left, of weight 1 / 0.1^2: 4 * (2 / 4) * 100 = 200.
    expected = 200 * np.array([[0.01, -0.02, 0.0], [-0.02, 0.04, 0.0], [0.0, 0.0, 0.0]])
    assert_allclose(noise_information(measured, weights_of(measured), UNCORRELATED), expected)
    assert_allclose(
        noise_information(measured, weights_of(measured, 0.25), UNCORRELATED), expected / 4
    )


def test_tracks_of_two_steps_fake_nothing_and_others_add_up():
    short = measured_of([2, 1, 2], [[0.3, 0.3, 0.3]] * 5)
    assert_allclose(noise_information(short, weights_of(short), UNCORRELATED), 0)
    both = measured_of([2, 4, 8], [[0.3, 0.3, 0.3]] * 2 + [[0.1, 0.0, 0.0]] * 12)
    # 100 * 0.01 * (4 * 2 / 4 + 8 * 6 / 8)
    assert_allclose(noise_information(both, weights_of(both), UNCORRELATED), np.diag([8.0, 0, 0]))


def test_rows_above_the_horizon_do_not_make_a_track_longer():
    # As measured, such rows have no direction noise; they are no rows of the track either.
    measured = measured_of([4], [[0.1, 0, 0]] * 2 + [[0, 0, 0]] * 2, [True, True, False, False])
    assert_allclose(noise_information(measured, weights_of(measured), UNCORRELATED), 0)


def test_no_tracks_fake_nothing():
    none = measured_of([], np.empty((0, 3)))
    assert_allclose(noise_information(none, weights_of(none), UNCORRELATED), np.zeros((3, 3)))


def test_without_noise_the_covariance_is_the_inverse():
    assert_allclose(corrected_covariance(MATRIX, np.zeros((3, 3))), np.linalg.inv(MATRIX))


def test_errors_scatter_by_all_and_are_brought_back_by_the_true_part():
    noise = np.array([[3.0, 1.0, 0.2], [1.0, 2.0, -0.5], [0.2, -0.5, 0.4]])
    true = np.linalg.inv(MATRIX - noise)
    assert_allclose(corrected_covariance(MATRIX, noise), true @ MATRIX @ true)
    # One axis alone: 4 of which 1 is noise, 4 / 3^2.
    found = corrected_covariance(np.diag([4.0, 1.0, 1.0]), np.diag([1.0, 0.0, 0.0]))
    assert_allclose(found, np.diag([4 / 9, 1.0, 1.0]))


def test_where_all_is_noise_a_twentieth_is_believed():
    found = corrected_covariance(MATRIX, 3 * MATRIX)
    assert_allclose(found, 400 * np.linalg.inv(MATRIX))
