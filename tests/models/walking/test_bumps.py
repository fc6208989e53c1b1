"""A field's features, by hand: on a grid, off it, and of nothing."""

import numpy as np
from numpy.testing import assert_allclose

from models.walking.field import exponents_at, features_of

GRID = np.array([[0.0, 0.0], [0.0, 6.0], [6.0, 0.0], [6.0, 6.0]])


def features(place, direction, centres):
    exponents, pair = exponents_at(np.array(place), centres, 6.0)
    return features_of(np.exp(exponents), pair, len(direction) > 0, np.array(direction))


def test_a_bump_falls_by_the_root_of_e_in_a_length():
    found = features([[6.0, 0.0]], [[0.6, -0.8]], GRID)
    # 1, x, y, x^2 - y^2, 2 x y; then e^-1/2 for each length along either axis.
    expected = [1, 0.6, -0.8, -0.28, -0.96, np.exp(-0.5), np.exp(-1), 1, np.exp(-0.5)]
    assert_allclose(found, [expected], rtol=1e-15)


def test_on_a_grid_exponentials_are_of_its_lines_alone():
    exponents, pair = exponents_at(np.zeros((3, 2)), GRID, 6.0)
    assert exponents.shape == (3, 4)  # two of x, two of y
    assert_allclose(pair, [[0, 2], [0, 3], [1, 2], [1, 3]])


def test_centres_may_stand_anywhere_and_an_axis_is_not_the_other():
    rng = np.random.default_rng(0)
    centres, place = rng.normal(0, 5, (7, 2)), rng.normal(0, 5, (11, 2))
    centres[3] = centres[2, ::-1]  # x of one is y of the other
    found = features(place, np.empty((0, 2)), centres)
    apart = np.linalg.norm(place[:, None] - centres, axis=-1)
    assert_allclose(found[:, 1:], np.exp(-(apart**2) / 72), rtol=1e-13)
    assert_allclose(found[:, 0], 1)


def test_no_rows_and_no_bumps():
    assert features(np.empty((0, 2)), np.empty((0, 2)), GRID).shape == (0, 5)
    assert_allclose(features([[1.0, 2.0]], [[1.0, 0.0]], np.empty((0, 2))), [[1, 1, 0, 1, 0]])
