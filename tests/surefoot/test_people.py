"""Which classes are pedestrians."""

import subprocess
import sys

import pytest

from surefoot.people import PEDESTRIANS, SkipReason, is_ignored, read_classes, skip_reason
from tests.conftest import ROOT


@pytest.mark.parametrize(
    "label", [0, 0.0, "0", "0.0", " 0 ", "person", "PERSON", "Pedestrians", "human", None, "",
              "nan", "null", -1, "-1", -1.0],
)  # fmt: skip
def test_pedestrians_and_missing_classes_are_included(label):
    assert PEDESTRIANS.include(label)


@pytest.mark.parametrize(
    "label", [1, "1", 2.0, 0.5, "0.5", "rider", "cyclist", "car", "person on vehicle", "face",
              "Person_sitting", "infinity"],
)  # fmt: skip
def test_other_classes_are_not_included(label):
    assert not PEDESTRIANS.include(label)


@pytest.mark.parametrize("label", [True, [], {}, float("nan"), float("inf")])
def test_value_that_is_no_class_is_an_error(label):
    with pytest.raises(ValueError, match="text or a "):
        PEDESTRIANS.include(label)


def test_list_of_classes_replaces_numbers_and_names_apart():
    numbers, names = read_classes("1, 7"), read_classes("Worker,construction_worker")
    assert [numbers.include(label) for label in (0, 1, "7.0", "person")] == [
        False,
        True,
        True,
        True,
    ]
    assert names.include("construction worker")
    assert not names.include("person")
    assert names.include(0)


@pytest.mark.parametrize("text", ["", "1,,2", "1;2", "-1", "1" * 7, ",".join("1" * 101)])
def test_text_that_is_no_list_of_classes_is_refused(text):
    with pytest.raises(ValueError, match="must be numbers or names separated by commas"):
        read_classes(text)


def test_confidence_of_exactly_0_is_ignored():
    assert [is_ignored(each) for each in (0, 0.0, "0", "0.00")] == [True] * 4
    used = (None, "", 0.01, 1, -1, "x", False, "nan")
    assert [is_ignored(each) for each in used] == [False] * len(used)
    assert skip_reason("car", 0) == SkipReason.NOT_A_PERSON
    assert skip_reason("person", 0) == SkipReason.CONFIDENCE
    assert skip_reason(None, 0.3) is None


def test_rule_needs_the_standard_library_only():
    program = "import sys, surefoot.people; print({'numpy', 'models'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.strip() == "set()"
