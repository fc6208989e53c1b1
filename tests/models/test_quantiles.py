"""Student's t against what is known of it in closed form and in tables."""

import math

import pytest

from models.quantiles import chance_below, value_below


def test_one_degree_of_freedom_is_cauchys_distribution():
    assert chance_below(1.0, 1.0) == pytest.approx(0.75)
    assert chance_below(-2.0, 1.0) == pytest.approx(0.5 - math.atan(2) / math.pi)
    assert value_below(0.75, 1.0) == pytest.approx(1.0)


def test_two_degrees_of_freedom_have_a_closed_form():
    # 1/2 + x / (2 sqrt(2 + x^2))
    assert chance_below(1.0, 2.0) == pytest.approx(0.5 + 0.5 / math.sqrt(3))
    assert chance_below(-3.0, 2.0) == pytest.approx(0.5 - 1.5 / math.sqrt(11))


@pytest.mark.parametrize(
    ("chance", "freedom", "value"),
    [(0.95, 4.0, 2.131847), (0.025, 10.0, -2.228139), (0.999, 30.0, 3.385185)],
)
def test_tables(chance, freedom, value):
    assert value_below(chance, freedom) == pytest.approx(value, abs=1e-6)
    assert chance_below(value, freedom) == pytest.approx(chance, abs=1e-7)


def test_many_degrees_of_freedom_are_the_normal_distribution():
    assert value_below(0.975, 1e9) == pytest.approx(1.959964, abs=1e-6)


def test_the_ends():
    assert chance_below(0.0, 3.0) == 0.5
    assert chance_below(math.inf, 3.0) == 1.0
    assert value_below(1.0, 3.0) == math.inf
