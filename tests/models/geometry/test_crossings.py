"""Counting lines after a move: who crosses them, who is missed, who is counted by mistake."""

import numpy as np
import pytest

from models.geometry.crossings import Crossings, Steps, crossings

LINE = np.array([[100.0, 200.0], [300.0, 200.0]])


def walk(*points):
    return np.array(points, float)


def crosses(feet, line=LINE):
    return Steps.of([feet]).crossing(np.array(line, float)).any()


@pytest.mark.parametrize(
    ("feet", "expected"),
    [
        (walk([200, 150], [200, 250]), True),  # down
        (walk([200, 250], [200, 150]), True),  # up
        (walk([200, 150], [200, 199]), False),  # stops before it
        (walk([99, 150], [99, 250]), False),  # passes its end
        (walk([0, 150], [200, 250]), True),  # meets it at u = 100, its very end
        (walk([0, 151], [198, 250]), False),  # meets it at u = 98
        (walk([200, 150], [200, 200], [200, 250]), True),  # a foot on it
        (walk([150, 200], [250, 200]), False),  # walks along it
        (walk([200, 150], [400, 150], [400, 250], [200, 250]), False),  # goes around it
        (walk([200, 150]), False),  # seen once
        (np.zeros((0, 2)), False),
    ],
)
def test_who_crosses_a_line(feet, expected):
    assert crosses(feet) is np.bool_(expected)
    assert crosses(feet, LINE[::-1]) is np.bool_(expected)
    assert crosses(feet[:, ::-1], LINE[:, ::-1]) is np.bool_(expected)


@pytest.mark.parametrize("line", [[[200, 200], [200, 200]], [[200, 200]], np.zeros((0, 2))])
def test_nobody_crosses_what_is_no_line(line):
    assert not crosses(walk([200, 150], [200, 250]), line)


def test_people_by_a_line_that_lies_60_px_too_high():
    now = LINE + [0, 60]  # v = 260
    feet = [
        walk([150, 100], [150, 400]),  # both
        walk([160, 300], [160, 150], [160, 300]),  # both, there and back
        walk([200, 220], [200, 300]),  # comes from between: missed
        walk([250, 240], [250, 280], [250, 240]),  # turns back: missed, once
        walk([220, 100], [220, 230]),  # ends between: counted by mistake
        walk([120, 100], [120, 150]),  # none
        walk([200, 190]),  # none
    ]
    assert crossings(Steps.of(feet), LINE, now) == Crossings(crossed=4, missed=2, false_counts=1)
    assert crossings(Steps.of([]), LINE, now) == Crossings(crossed=0, missed=0, false_counts=0)
