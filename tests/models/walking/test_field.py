"""The field of what is usual: its prior, its derivatives, its size."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.tracks.observations import Rows
from models.walking.field import FieldShape, field_over
from models.walking.measures import Measured

SHAPE = FieldShape(level=0.3, level_sd=0.1, length_m=6.0, place_sd=0.1, direction_sd=0.08)


def measured_at(place: np.ndarray, *, seed: int = 0) -> Measured:
    rng = np.random.default_rng(seed)
    count = len(place)
    angle = rng.uniform(0, 2 * np.pi, count)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    turn = rng.normal(size=(count, 1, 3))
    aside = np.stack([-direction[:, 1], direction[:, 0]], axis=1)[:, :, None]
    return Measured(
        value=np.zeros(count),
        place=place,
        direction=direction,
        valid=np.ones(count, dtype=bool),
        d_value=np.zeros((count, 3)),
        d_place=rng.normal(size=(count, 2, 3)),
        d_direction=aside * turn,
        d_direction_noise=np.zeros((count, 3)),
        rows=Rows(
            owner_idx=np.arange(count),
            linked=np.zeros(count, dtype=bool),
            time_s=np.zeros(count),
            when=np.zeros(count),
            owners=count,
        ),
    )


def test_every_place_may_vary_as_much_as_the_shape_says():
    place = np.random.default_rng(0).uniform(-20, 20, (500, 2))
    field = field_over(measured_at(place), SHAPE)
    inner = measured_at(np.random.default_rng(1).uniform(-12, 12, (50, 2)))
    bumps = field.features(inner)[:, 5:]
    sd = np.sqrt((bumps**2) @ field.prior_variance[5:])
    assert_allclose(sd, 0.1, rtol=0.05)
    assert field.prior_mean[0] == 0.3
    assert_allclose(field.prior_variance[:5], [0.01, *[0.0064] * 4])


@pytest.mark.parametrize("number", [0, 1, 2])
def test_slopes_are_those_of_differences(number):
    place = np.random.default_rng(2).uniform(-10, 10, (30, 2))
    here = measured_at(place)
    field = field_over(here, SHAPE)
    coefficients = np.random.default_rng(3).normal(size=field.prior_mean.size)
    step = 1e-6

    def mean(sign: float) -> np.ndarray:
        assert here.direction is not None
        assert here.d_direction is not None
        moved = Measured(
            value=here.value,
            place=here.place + sign * step * here.d_place[:, :, number],
            direction=here.direction + sign * step * here.d_direction[:, :, number],
            valid=here.valid,
            d_value=here.d_value,
            d_place=here.d_place,
            d_direction=here.d_direction,
            d_direction_noise=here.d_direction_noise,
            rows=here.rows,
        )
        return field.features(moved) @ coefficients

    said = field.slopes(here, field.features(here), coefficients)[:, number]
    assert_allclose(said, (mean(1) - mean(-1)) / (2 * step), atol=1e-6)


def test_a_wide_site_has_wider_bumps_not_more():
    place = np.random.default_rng(4).uniform(-200, 200, (1500, 2))
    field = field_over(measured_at(place), SHAPE)
    assert len(field.centres) <= 150
    assert field.length_m > 6.0


def test_nowhere_seen_is_a_level_and_directions_only():
    field = field_over(measured_at(np.empty((0, 2))), SHAPE)
    assert field.centres.shape == (0, 2)
    assert field.prior_mean.size == 5
