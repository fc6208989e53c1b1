"""`python -m studies alarm-study`: tables, and JSON in which never is null."""

import json

import pytest
from typer.testing import CliRunner

from studies.__main__ import app
from studies.alarms.results import AlarmResults, Delay
from studies.alarms.tables import delay_table, still_table


def results(name, alarms, tracks):
    delays = tuple(Delay(angle_deg=5.0, pan=False, tracks=t) for t in tracks)
    return AlarmResults(
        name=name,
        seed=0,
        walking_groups=60,
        years=2.0,
        false_alarms=alarms,
        highest=0.4,
        pose_excess=0.2,
        delays=delays,
    )


def cells(table, column):
    return list(table.columns[column].cells)


def test_tables_count_alarms_a_year_and_shares_within_the_bar():
    found = [results("a", 1, [10, 70]), results("b", 0, [59, float("inf")])]
    still = still_table("still", found)
    assert cells(still, 0) == ["a", "b", "all"]
    assert cells(still, 3) == ["1", "0", "1"]
    assert cells(still, 4)[0] == "0.50 (0.50 to 1.84)"  # none seen in 2 years: up to 3.69 / 2
    assert cells(still, 4)[2].startswith("0.25")
    delay = delay_table("delay", found)
    assert cells(delay, 1) == ["50%, 40", "50%, never", "50%, 64"]


@pytest.mark.slow
def test_a_study_writes_what_it_finds(tmp_path):
    output = tmp_path / "study.json"
    asked = ["alarm-study", "--sites", "1", "--days", "7", "--processes", "1"]
    done = CliRunner().invoke(app, [*asked, "--output", str(output)])
    assert done.exit_code == 0, done.output
    assert "1 simulated sites; 1 false alarms a camera-year are set" in done.output
    document = json.loads(output.read_text())
    assert document["plan"]["reference_tracks"] == 200
    (result,) = document["results"]
    assert result["years"] == pytest.approx(7 / 365.25)
    assert {delay["angle_deg"] for delay in result["delays"]} == {1.0, 2.0, 5.0}
    assert "Infinity" not in output.read_text()
