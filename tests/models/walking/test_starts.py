"""Where the fit begins: a made-up site whose speeds agree at one pose alone."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.tracks.observations import Rows
from models.walking.field import Field
from models.walking.fit import Channel, Learned
from models.walking.measures import Measured
from models.walking.mixed.model import VarianceComponents
from models.walking.starts import starts

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
