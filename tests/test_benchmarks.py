"""Benchmarks are run by hand: here, that each can still be."""

import importlib
import sqlite3
import sys

import pytest

from tests.benchmarks import __main__ as every
from tests.benchmarks.parts.monitored import Checks, delays_s, knock_alerts, stored
from tests.conftest import ROOT

HERE = ROOT / "tests" / "benchmarks"
MODULES = sorted(
    ".".join(path.relative_to(HERE).with_suffix("").parts)
    for path in HERE.rglob("*.py")
    if path.name != "__init__.py" and path != HERE / "__main__.py"
)


@pytest.mark.parametrize("name", MODULES)
def test_each_finds_all_that_it_is_made_of(name):
    importlib.import_module(f"tests.benchmarks.{name}")


def test_one_command_runs_those_that_there_are(monkeypatch, capsys):
    assert set(every.BENCHMARKS) < set(MODULES)
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "runs,rusn"])
    with pytest.raises(SystemExit):
        every.main()
    assert "got rusn" in capsys.readouterr().err


@pytest.fixture
def knocked(tmp_path):
    """A database in which cameras "a" and "b" got a track each 5 s; "a" had an alert after 21 s."""
    path = tmp_path / "some.db"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE tracks (camera_id, id, received_at)")
        connection.execute("CREATE TABLE alerts (camera_id, kind, opened_at)")
        for n in range(6):
            rows = [("a", 2 * n, stored(5.0 * n)), ("b", 2 * n + 1, stored(5.0 * n))]
            connection.executemany("INSERT INTO tracks VALUES (?, ?, ?)", rows)
        found = [("a", "no_data", stored(9.0)), ("a", "drift", stored(21.0))]
        connection.executemany("INSERT INTO alerts VALUES (?, ?, ?)", found)
    return path


def test_delay_of_a_track_is_to_the_first_check_that_read_it(knocked):
    checks = {"a": Checks(pks=[2, 10], seen_s=[6.0, 26.0]), "b": Checks(pks=[5], seen_s=[12.0])}
    delays, overdue = delays_s(knocked, checks, 0.0, 26.0, 8.0)
    # Of "b", the track of 15 s waits for 11 s, those of 20 and 25 s for less than 8 s.
    assert sorted(delays) == pytest.approx(sorted([6, 1, 16, 11, 6, 1, 12, 7, 2]))
    assert overdue == 1


@pytest.mark.parametrize(
    ("pks", "seen_s", "after_cause_s"),
    [
        ([2, 6, 8], [6.0, 16.0, 21.3], 1.0),  # the run before had read the track of 15 s
        ([2, 8], [6.0, 21.3], 11.0),  # it had read that of 5 s alone
        ([2, 6, 8, 9], [6.0, 16.0, 20.4, 21.3], 1.0),  # a run without new tracks opened it
    ],
)
def test_alert_is_caused_by_the_oldest_track_that_the_run_before_had_not_read(
    knocked, pks, seen_s, after_cause_s
):
    (found,) = knock_alerts(knocked, {"a": Checks(pks=pks, seen_s=seen_s)}, ["a", "b"], 0.0)
    assert (found.camera_id, found.kind, found.tracks) == ("a", "drift", 5)
    assert found.after_knock_s == pytest.approx(21.0)
    assert found.after_cause_s == pytest.approx(after_cause_s)
