"""A part that is off is off, and comes back; what a part replaces is there."""

import pytest

from models.errors import ShapeError
from models.tracks import walks
from studies.faults.catalogue import FAULTS
from studies.served.parts import WHOLE, PartFigures, run_parts, table_of, wanted_rows
from studies.served.parts_catalogue import PARTS
from studies.served.tasks import Table


@pytest.mark.parametrize("name", PARTS)
def test_every_part_can_be_switched_off(name):
    part = PARTS[name]
    assert part.lines > 1
    assert set(part.faults) <= {*FAULTS, *Table}
    with part.switched_off():
        pass


def test_a_part_is_off_within_and_on_again_after():
    before = walks.link_pieces
    with PARTS["pieces"].switched_off():
        assert walks.link_pieces([1, 2, 3], None, None).tolist() == [-1, -1, -1]
    assert walks.link_pieces is before


def test_the_table_has_a_row_for_what_was_measured():
    figures = {
        "cases": 10, "still_deg": 0.5, "moved_deg": 1.0, "moved_p90_deg": 3.0,
        "height_error": 0.02, "covered": 0.9, "beyond": 1, "cut": 0.0, "told": 0.5, "cpu_s": 0.4,
        "false_alarms": 3,
    }  # fmt: skip
    rows = [
        PartFigures(part=WHOLE, fault="", **figures),
        PartFigures(part="pieces", fault="fragments", **figures),
        PartFigures(part="other modes", fault="far", **figures | {"still_deg": None}),
    ]
    lines = table_of(rows).splitlines()
    assert len(lines) == 5
    assert "| far | 10 | - | 1.00 (3.0) |" in lines[4]  # nothing stands there
    assert lines[2].startswith("| nothing | nothing wrong | 10 | 0.50 | 1.00 (3.0) | 2.0% | 90%")
    assert lines[3].startswith("| pieces: pieces of one walk are put together | fragments |")
    assert lines[3].endswith(f"| 0% | 50% | 3 | 0.40 | {PARTS['pieces'].lines} |")


def test_only_some_parts_are_measured_and_those_that_are_none_are_named(tmp_path):
    some = {"seeds": 1, "processes": 1, "output": tmp_path / "parts.jsonl", "page": None}
    with pytest.raises(ShapeError, match="part: .*, jumps, .* are known, got 'stilts'"):
        run_parts([], **some, only=["stilts"])
    assert {fault for _, fault in wanted_rows(["jumps"])} == {"", "jumps", "jumps-later"}
    assert {part for part, _ in wanted_rows(["jumps"])} == {WHOLE, "jumps"}
