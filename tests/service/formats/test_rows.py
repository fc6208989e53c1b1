"""Rows of numbers that are read quickly: what is right in every way, and nothing else."""

import math
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.formats import json_track
from service.formats.json_track import LARGEST, plain_rows

_NUMBERS = st.one_of(
    st.floats(),
    st.integers(),
    st.sampled_from((LARGEST - 1, LARGEST, LARGEST + 1, 10**400, -LARGEST, -0.0)),
)
_CELLS = st.one_of(_NUMBERS, st.booleans(), st.none(), st.text(max_size=2), st.just([1.0]))


@pytest.mark.parametrize(
    "wrong",
    [
        [],
        [[]],
        [[1.0, 2.0]],
        [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0, 5.0]],
        [[1.0, 2.0, 3.0], "abc"],
        [[1.0, 2.0, True]],
        [[1.0, 2.0, "3"]],
        [[1.0, 2.0, None]],
        [[1.0, 2.0, math.nan]],
        [[1.0, 2.0, math.inf]],
        [[1.0, 2.0, LARGEST + 1]],
        [[1.0, 2.0, 10**400]],
    ],
)
def test_what_there_is_something_to_say_of_is_left_to_who_says_it(wrong):
    assert plain_rows(wrong, (3, 5)) is None


def test_good_rows_are_an_array_of_their_own():
    rows = [[0, 1.5, 2], [1, 2.5, LARGEST - 1]]
    found = plain_rows(rows, (3, 5))
    assert found.tolist() == rows
    assert found.dtype == np.float64
    assert found.flags.writeable  # frames become times in it


def closely(rows):
    """What comes of rows where each number is looked at."""
    try:
        return json_track._numbers("points", rows, (3, 5)).tolist()
    except json_track.TrackRejectedError as refused:
        return refused.code, refused.detail


@given(
    st.lists(st.lists(_CELLS, max_size=6), max_size=4)
    | st.lists(st.lists(_NUMBERS, min_size=3, max_size=3), max_size=4)
)
def test_it_comes_to_the_same_as_a_close_look(rows):
    quick = closely(rows)
    with patch.object(json_track, "plain_rows", lambda *_: None):
        assert repr(closely(rows)) == repr(quick)
