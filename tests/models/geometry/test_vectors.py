import numpy as np

from models.geometry.vectors import aside_of, dot, norm


def test_products_lengths_and_quarter_turns_are_row_by_row():
    first, second = np.array([[3.0, 4.0], [0.0, -2.0]]), np.array([[1.0, 2.0], [5.0, 0.5]])
    np.testing.assert_array_equal(dot(first, second), [11.0, -1.0])
    np.testing.assert_array_equal(norm(first), [5.0, 2.0])
    np.testing.assert_array_equal(aside_of(first), [[-4.0, 3.0], [2.0, 0.0]])


def test_they_take_whatever_stands_before_the_last_axis():
    many = np.random.default_rng(0).normal(size=(2, 5, 3))
    np.testing.assert_allclose(norm(many), np.linalg.norm(many, axis=-1))
    assert dot(many, many).shape == (2, 5)
    assert norm(np.empty((0, 2))).shape == (0,)
