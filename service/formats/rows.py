"""Rows of numbers out of JSON, read quickly where there is nothing to say of them."""

from itertools import chain
from typing import Any

import numpy as np

from models.geometry.rotation import Array

LARGEST = 2**53  # up to which floats tell whole numbers apart


def plain_rows(value: list[Any], lengths: tuple[int, ...]) -> Array | None:
    """The array (N, columns) of a list that is right in every way; None of any other.

    All its rows are lists of one of the lengths, of numbers within `LARGEST`. Who says what is
    wrong looks at one number after another.
    """
    if set(map(type, value)) != {list} or len(found := set(map(len, value))) != 1:
        return None
    numbers = list(chain.from_iterable(value))
    if not found <= set(lengths) or not set(map(type, numbers)) <= {int, float}:
        return None
    try:
        rows = np.array(numbers, dtype=np.float64)
    except OverflowError:  # a whole number that no float holds
        return None
    # One more than the largest may have been rounded to it; NaN is below nothing.
    return rows.reshape(len(value), -1) if np.abs(rows).max() < LARGEST else None
