from math import acos, cos, pi, radians, sin

import cv2
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from models.errors import ShapeError
from models.geometry.rotation import (
    angle_between,
    angles_from_rotation,
    aside_of,
    dot,
    mean_quaternion,
    nearest_rotation,
    norm,
    quaternion_from_rotation,
    rotation_from_angles,
    rotation_from_quaternion,
)
from tests.strategies import angles


def about(axis: tuple[float, float, float], angle_deg: float) -> np.ndarray:
    """The quaternion wxyz of a turn about a unit axis."""
    half = radians(angle_deg) / 2
    return np.array([cos(half), *(sin(half) * np.array(axis))])


def turns(rng: np.random.Generator, count: int) -> np.ndarray:
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


# Pins


def test_rotation_of_asymmetric_angles() -> None:
    # Composed by hand from the turns about world Z (60), camera x (20) and camera z (10 deg).
    expected = [
        [0.44096961, -0.88256412, -0.16317591],
        [-0.37852231, -0.01802831, -0.92541658],
        [0.81379768, 0.46984631, -0.34202014],
    ]
    made = rotation_from_angles(radians(20), radians(10), radians(60))
    assert_allclose(made, expected, atol=1e-8)


def test_quaternion_of_a_tilted_camera() -> None:
    # Looking level along +Y is a turn of 90 deg about x; a tilt of 30 deg makes it 120.
    q = quaternion_from_rotation(rotation_from_angles(radians(30), 0, 0))
    assert_allclose(q, [0.5, 0.8660254, 0, 0], atol=1e-7)


def test_quaternion_of_a_camera_that_looks_east() -> None:
    # Rows (0, -1, 0), (0, 0, -1), (1, 0, 0): 120 deg about (1, -1, 1).
    q = quaternion_from_rotation(rotation_from_angles(0, 0, radians(90)))
    assert_allclose(q, [0.5, 0.5, -0.5, 0.5], atol=1e-12)


def test_rotation_of_a_quaternion_is_of_wxyz_order() -> None:
    # 90 deg about z takes x to y.
    assert_allclose(rotation_from_quaternion(about((0, 0, 1), 90)) @ [1, 0, 0], [0, 1, 0],
                    atol=1e-12)  # fmt: skip


def test_angle_between_turns_about_one_axis() -> None:
    assert angle_between(about((0, 0, 1), 10), about((0, 0, 1), 47)) == pytest.approx(radians(37))


def test_angle_between_counts_a_quaternion_and_its_negative_as_one() -> None:
    first, second = about((0, 1, 0), 20), about((0, 1, 0), 50)
    assert angle_between(first, -second) == pytest.approx(radians(30))
    assert angle_between(first, -first) == 0


def test_angle_between_keeps_the_digits_of_small_angles() -> None:
    tiny = np.array([1.0, 5e-10, 0, 0])
    assert angle_between([1, 0, 0, 0], tiny) == pytest.approx(1e-9, rel=1e-6)


def test_angle_between_is_never_more_than_half_a_turn() -> None:
    assert angle_between(about((1, 0, 0), 0), about((1, 0, 0), 350)) == pytest.approx(radians(10))
    assert angle_between([1, 0, 0, 0], [0, 0, 1, 0]) == pytest.approx(pi)


def test_mean_of_two_turns_is_half_way() -> None:
    mean = mean_quaternion(np.array([about((0, 0, 1), 10), about((0, 0, 1), 30)]))
    assert_allclose(mean, about((0, 0, 1), 20), atol=1e-12)


def test_mean_does_not_depend_on_the_sign_of_its_quaternions() -> None:
    q = np.array([about((0, 0, 1), 10), -about((0, 0, 1), 30), about((1, 0, 0), 5)])
    assert_allclose(mean_quaternion(q), mean_quaternion(-q * [[1], [-1], [1]]), atol=1e-12)
    assert mean_quaternion(-q)[0] > 0


def test_weighted_mean_of_two_turns_about_one_axis() -> None:
    # tan a = (3 sin 0 + 1 sin 40) / (3 cos 0 + 1 cos 40) = 0.642788 / 3.766044: a = 9.6859 deg.
    q = np.array([about((0, 0, 1), 0), about((0, 0, 1), 40)])
    mean = mean_quaternion(q, np.array([3.0, 1.0]))
    assert np.degrees(angle_between(mean, q[0])) == pytest.approx(9.6859, abs=1e-4)


def test_a_weight_is_so_many_copies() -> None:
    q = turns(np.random.default_rng(1), 3)
    copies = q[[0, 0, 1, 2, 2, 2]]
    assert_allclose(mean_quaternion(q, np.array([2.0, 1, 3])), mean_quaternion(copies), atol=1e-9)


# Round trips


@given(angles(-89.9, 89.9), angles(-179.9, 179.9), angles(-179.9, 179.9))
def test_angles_round_trip(tilt: float, roll: float, heading: float) -> None:
    found = angles_from_rotation(rotation_from_angles(tilt, roll, heading))
    assert_allclose(found, (tilt, roll, heading), atol=1e-9)


@given(angles(-90, 90), angles(-180, 180), angles(-180, 180))
def test_quaternion_round_trip(tilt: float, roll: float, heading: float) -> None:
    rotation = rotation_from_angles(tilt, roll, heading)
    q = quaternion_from_rotation(rotation)
    assert q[0] >= 0
    assert np.linalg.norm(q) == pytest.approx(1)
    assert_allclose(rotation_from_quaternion(q), rotation, atol=1e-12)


@given(angles(-90, 90), angles(-180, 180), angles(-180, 180))
def test_rotations_are_right_handed_and_orthonormal(tilt: float, roll: float, head: float) -> None:
    rotation = rotation_from_angles(tilt, roll, head)
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_half_turns_survive_the_way_over_a_quaternion() -> None:
    # w = 0: the short formula by the trace divides by zero here.
    for axis in np.eye(3):
        rotation = 2 * np.outer(axis, axis) - np.eye(3)
        q = quaternion_from_rotation(rotation)
        assert_allclose(rotation_from_quaternion(q), rotation, atol=1e-12)


def test_many_at_once_are_as_one_at_a_time() -> None:
    rng = np.random.default_rng(2)
    tilt, roll, heading = rng.uniform(-1.5, 1.5, (3, 4, 5))
    rotations = rotation_from_angles(tilt, roll, heading)
    quaternions = quaternion_from_rotation(rotations)
    assert rotations.shape == (4, 5, 3, 3)
    assert quaternions.shape == (4, 5, 4)
    one = rotation_from_angles(tilt[2, 3], roll[2, 3], heading[2, 3])
    assert_allclose(rotations[2, 3], one, atol=1e-15)
    assert_allclose(quaternions[2, 3], quaternion_from_rotation(one), atol=1e-15)
    assert_allclose(mean_quaternion(quaternions)[1], mean_quaternion(quaternions[1]), atol=1e-12)
    assert_allclose(angles_from_rotation(rotations)[1][2, 3], roll[2, 3], atol=1e-12)


# Oracles


def test_rotation_of_a_quaternion_is_that_of_rodrigues() -> None:
    for q in turns(np.random.default_rng(3), 20):
        angle = 2 * acos(q[0])
        expected, _ = cv2.Rodrigues(angle * q[1:] / np.linalg.norm(q[1:]))
        assert_allclose(rotation_from_quaternion(q), expected, atol=1e-9)


def test_angle_between_is_the_length_of_the_relative_rodrigues_vector() -> None:
    q = turns(np.random.default_rng(4), 40).reshape(20, 2, 4)
    for first, second in q:
        relative = rotation_from_quaternion(first).T @ rotation_from_quaternion(second)
        vector, _ = cv2.Rodrigues(relative)
        assert angle_between(first, second) == pytest.approx(np.linalg.norm(vector), abs=1e-6)


def test_mean_is_the_turn_with_the_least_squared_chordal_distance() -> None:
    q = turns(np.random.default_rng(5), 6)

    def distance(candidate: np.ndarray) -> float:
        return sum(
            np.linalg.norm(rotation_from_quaternion(candidate) - rotation_from_quaternion(one)) ** 2
            for one in q
        )

    mean = mean_quaternion(q)
    others = turns(np.random.default_rng(6), 200)
    near = mean + 0.01 * np.random.default_rng(7).normal(size=(50, 4))
    assert all(distance(mean) < distance(other) for other in (*others, *near))


# Degenerate cases


@pytest.mark.parametrize("tilt_deg", [90, -90])
def test_looking_straight_down_or_up_has_roll_zero_and_keeps_the_rotation(tilt_deg: float) -> None:
    rotation = rotation_from_angles(radians(tilt_deg), radians(25), radians(60))
    tilt, roll, heading = angles_from_rotation(rotation)
    assert float(tilt) == pytest.approx(radians(tilt_deg))
    assert float(roll) == pytest.approx(0, abs=1e-9)
    assert_allclose(rotation_from_angles(tilt, roll, heading), rotation, atol=1e-9)


def test_a_quaternion_of_any_length_is_normalised_and_one_of_none_refused() -> None:
    q = about((0, 0, 1), 33)
    assert_allclose(rotation_from_quaternion(7 * q), rotation_from_quaternion(q), atol=1e-12)
    with pytest.raises(ShapeError, match="length"):
        rotation_from_quaternion([0, 0, 0, 0])


def test_a_quaternion_of_three_numbers_is_refused() -> None:
    with pytest.raises(ShapeError, match="quaternion_wxyz"):
        rotation_from_quaternion([1, 0, 0])


def test_nearest_rotation_repairs_rounding() -> None:
    rotation = rotation_from_angles(0.3, 0.1, 2.0)
    repaired = nearest_rotation(np.round(rotation, 4))
    assert_allclose(repaired @ repaired.T, np.eye(3), atol=1e-12)
    assert_allclose(repaired, rotation, atol=1e-4)


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (np.diag([1.0, 1, -1]), "reflection"),
        (1.01 * np.eye(3), "0.01"),
        (np.zeros((3, 3)), "orthonormal"),
        (np.eye(4), r"\(4, 4\)"),
        (np.full((3, 3), np.nan), "finite"),
    ],
)
def test_nearest_rotation_refuses_what_is_none(matrix: np.ndarray, says: str) -> None:
    with pytest.raises(ShapeError, match=says):
        nearest_rotation(matrix)


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
