"""`python -m studies flow-study` says what its sites showed."""

import json
from io import StringIO

import pytest
from rich.console import Console

from models.reasons import Reason, TracksCode
from models.simulation.poses import PoseOffset
from studies.paths.flow_study import ChangedResult, OffsetResult, SiteResults
from studies.paths.flow_tables import changed_table, knocked_table
from tests.service.commands.test_replay import surefoot


def site(number: int, error_deg: float, *, off_deg: float) -> SiteResults:
    return SiteResults(
        site=number,
        knock=PoseOffset(),
        knocked=(
            OffsetResult(
                tracks=25,
                errors=(error_deg, -error_deg, 2 * error_deg, error_deg / 100),
                covered=(True, True, error_deg < 2, True),
                angle_error_deg=error_deg,
            ),
        ),
        changed=(
            ChangedResult(
                tracks=200,
                off_truth_deg=off_deg,
                off_unchanged_deg=off_deg,
                unchanged_off_truth_deg=0.1,
                off_truth_log_height=0.0,
                covered=(True, True, off_deg < 1, True),
                registered=True,
                reason=Reason(code=TracksCode.PATHS_CHANGED) if off_deg > 1 else None,
            ),
        ),
        simulated_s=1.0,
        learned_s=1.0,
        estimated_s=1.0,
    )


@pytest.fixture
def found() -> list[SiteResults]:
    return [site(0, 1.0, off_deg=0.5), site(1, -1.5, off_deg=0.7), site(2, 3.0, off_deg=40.0)]


def printed(table) -> list[str]:
    console = Console(width=300, file=StringIO())
    console.print(table)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 110
    return [cell.strip() for cell in lines[-2].strip("│").split("│")]


def test_errors_are_without_sign_and_coverage_stands_beside_them(found):
    # 1, 1.5, 3: median 1.5, 90th percentile 1.5 + 0.8 * 1.5 = 2.7.
    assert printed(knocked_table(found)) == [
        "25", "1.50 (2.70) 100%", "1.50 (2.70) 100%", "3.00 (5.40) 67%", "1.50 (2.70) 100%",
    ]  # fmt: skip


def test_moves_by_new_paths_are_told_with_the_worst_and_whether_paths_are_named(found):
    cells = printed(changed_table(found))
    # 0.5, 0.7, 40: the 90th percentile is 0.7 + 0.8 * 39.3 = 32.14.
    assert cells == [
        "200", "0.70 (32.14; 40.00)", "0.70 (32.14; 40.00)", "0.10 (0.10; 0.10)",
        "33%", "67%", "33%",
    ]  # fmt: skip


@pytest.mark.slow
def test_the_command_prints_tables_and_writes_every_site(tmp_path):
    output = tmp_path / "study.json"
    text = surefoot("studies", "flow-study", "--sites", "1", "--seed", "3", "--output", str(output))
    assert "half on a new path" in text
    written = json.loads(output.read_text())
    (only,) = written["sites"]
    assert [result["tracks"] for result in only["knocked"]] == [25, 100, 400]
    assert [result["tracks"] for result in only["changed"]] == [200, 400]
    assert written["seed"] == 3
