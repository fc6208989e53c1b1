"""Features of a field at places and directions.

A bump is one of x times one of y, and centres on a grid share their x and y: there are fewer
exponentials than bumps.
"""

import numpy as np
import numpy.typing as npt

from models.compiled import compiled
from models.geometry.rotation import Array


@compiled
def exponents_at(
    place: Array, centres: Array, length_m: float
) -> tuple[Array, npt.NDArray[np.int64]]:
    """Logarithms (M, L) of bumps of x or y alone, and which two (K, 2) make each bump.

    Args:
        place: on the ground (M, 2), metres.
        centres: of the bumps (K, 2), metres.
        length_m: of the bumps.
    """
    bumps = len(centres)
    pair, middles = np.empty((bumps, 2), dtype=np.int64), np.empty(2 * bumps)
    axes: list[int] = []
    for axis in range(2):
        begin = len(axes)
        for k in range(bumps):
            found = begin
            while found < len(axes) and middles[found] != centres[k, axis]:
                found += 1
            if found == len(axes):
                middles[found] = centres[k, axis]
                axes.append(axis)
            pair[k, axis] = found
    exponents, fall = np.empty((len(place), len(axes))), -1 / (2 * length_m**2)
    for j in range(len(place)):
        for line, axis in enumerate(axes):
            apart = place[j, axis] - middles[line]
            exponents[j, line] = apart * apart * fall
    return exponents, pair


@compiled
def features_of(
    falls: Array, pair: npt.NDArray[np.int64], directional: bool, direction: Array
) -> Array:
    """A field's features (M, P): 1, four of the direction where it has any, and K bumps.

    Args:
        falls: bumps of x or y alone (M, L).
        pair: which two make each bump (K, 2).
        directional: whether the field has directions.
        direction: unit vectors (M, 2), where it has.
    """
    first = 5 if directional else 1
    features = np.empty((len(falls), first + len(pair)))
    for j in range(len(falls)):
        row, fall = features[j], falls[j]
        row[0] = 1.0
        if directional:
            x, y = direction[j]
            row[1], row[2], row[3], row[4] = x, y, x * x - y * y, 2 * x * y
        for k in range(len(pair)):
            row[first + k] = fall[pair[k, 0]] * fall[pair[k, 1]]
    return features


@compiled
def slopes_of(
    east: Array,
    north: Array,
    total: Array,
    length_m: float,
    place: Array,
    d_place: Array,
    coefficients: Array,
    directional: bool,
    direction: Array,
    d_direction: Array,
) -> Array:
    """Derivatives (M, 3) of a field's mean by tilt, roll, log height.

    Args:
        east: sums of bumps times their coefficients and their centres' x (M,).
        north: the same with y (M,).
        total: the same with 1 (M,).
        length_m: of the bumps.
        place: on the ground (M, 2), metres.
        d_place: derivatives of that (M, 2, 3).
        coefficients: of the field (P,).
        directional: whether the field has directions.
        direction: unit vectors (M, 2), where it has.
        d_direction: derivatives of those (M, 2, 3).
    """
    slopes = np.empty((len(place), 3))
    for j in range(len(place)):
        by_x = (east[j] - total[j] * place[j, 0]) / length_m**2
        by_y = (north[j] - total[j] * place[j, 1]) / length_m**2
        for number in range(3):
            slopes[j, number] = by_x * d_place[j, 0, number] + by_y * d_place[j, 1, number]
        if directional:
            x, y = direction[j]
            a, b, c, d = coefficients[1], coefficients[2], coefficients[3], coefficients[4]
            by_x, by_y = a + 2 * (c * x + d * y), b + 2 * (d * x - c * y)
            for number in range(3):
                slopes[j, number] += (
                    by_x * d_direction[j, 0, number] + by_y * d_direction[j, 1, number]
                )
    return slopes
