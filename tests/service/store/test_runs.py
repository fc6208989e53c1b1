"""Counts of estimation runs: totals never fall, and hours are the differences between them."""

from datetime import UTC, datetime, timedelta

import pytest

from service.enums import RunKind
from service.store import runs
from service.store.engines.store import Store
from service.store.runs import RunTotal

HOUR = timedelta(hours=1)
NOW = datetime(2026, 11, 28, 9, 30, tzinfo=UTC)


@pytest.fixture
def session(settings):
    store = Store(settings)
    with store.write() as session:
        yield session
    store.close()


def add(session, kind, count, cpu_s, now):
    runs.add(session, {kind: RunTotal(runs=count, cpu_s=cpu_s)}, now)


def test_totals_without_runs_are_zero_for_each_kind(session):
    assert runs.totals(session) == dict.fromkeys(RunKind, RunTotal())
    assert runs.by_hour(session, 3, NOW)[RunKind.FULL] == [RunTotal()] * 3


def test_runs_of_several_heartbeats_add_up_by_kind(session):
    add(session, RunKind.MONITOR, 10, 0.05, NOW)
    add(session, RunKind.MONITOR, 5, 0.025, NOW + timedelta(seconds=2))
    add(session, RunKind.FULL, 1, 0.2, NOW + HOUR)
    found = runs.totals(session)
    assert found[RunKind.MONITOR] == RunTotal(runs=15, cpu_s=pytest.approx(0.075))
    assert found[RunKind.FULL] == RunTotal(runs=1, cpu_s=0.2)


def test_by_hour_has_zero_for_an_hour_without_runs(session):
    for hours_ago, count in ((30, 7), (3, 4), (1, 2), (0, 1)):
        add(session, RunKind.FULL, count, 0.5 * count, NOW - hours_ago * HOUR)
    found = runs.by_hour(session, 4, NOW)[RunKind.FULL]
    assert [each.runs for each in found] == [4, 0, 2, 1]
    assert [each.cpu_s for each in found] == pytest.approx([2.0, 0.0, 1.0, 0.5])


def test_clock_set_back_keeps_counting_in_the_newest_hour(session):
    add(session, RunKind.FULL, 3, 0.3, NOW)
    add(session, RunKind.FULL, 2, 0.2, NOW - 2 * HOUR)
    assert runs.totals(session)[RunKind.FULL].runs == 5
    assert [each.runs for each in runs.by_hour(session, 1, NOW)[RunKind.FULL]] == [5]


def test_forget_deletes_old_hours_and_keeps_the_total(session):
    for hours_ago in (200, 190, 180):
        add(session, RunKind.MONITOR, 10, 0.1, NOW - hours_ago * HOUR)
    add(session, RunKind.FULL, 1, 0.2, NOW)
    session.flush()
    assert runs.forget(session, NOW - 168 * HOUR, 500) == 2
    assert runs.totals(session)[RunKind.MONITOR].runs == 30
    add(session, RunKind.MONITOR, 1, 0.01, NOW)
    assert [each.runs for each in runs.by_hour(session, 2, NOW)[RunKind.MONITOR]] == [0, 1]
