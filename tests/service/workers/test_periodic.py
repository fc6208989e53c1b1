"""The rounds of the upkeep: the quick ones do not wait for those of an hour."""

import threading

import pytest

from service.workers.context import UPKEEP, JobContext, RunningJobs
from service.workers.upkeep import periodic
from service.workers.upkeep.retention import BITE, Limit, run_retention
from tests.service.bench import Bench


@pytest.fixture
def context(bench: Bench) -> JobContext:
    return JobContext(
        settings=bench.settings,
        store=bench.store,
        queue=bench.queue,
        running=RunningJobs(limits_s={UPKEEP: 60.0}),
    )


def test_sweeps_go_on_while_the_hourly_work_takes_long(
    context: JobContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, swept = threading.Event(), threading.Semaphore(0)

    def retain(_: JobContext) -> None:
        begun.set()
        context.stopping.wait(30)

    monkeypatch.setattr(periodic, "_FIRST_HOURLY_S", 0.0)
    monkeypatch.setattr(periodic, "run_retention", retain)
    monkeypatch.setattr(periodic, "run_sweep", lambda _: swept.release())
    periodic.start_periodic_work(context)
    try:
        assert begun.wait(20)
        while swept.acquire(blocking=False):
            pass  # those before it began
        assert swept.acquire(timeout=20), "no sweep while the retention goes on"
        assert swept.acquire(timeout=20)
        assert not context.running.overdue()
    finally:
        context.stopping.set()


def test_each_bite_of_the_retention_has_the_limit_to_itself(
    context: JobContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A retention of hours is work; one bite that never ends hangs."""
    seen: list[int] = []

    def bite(_: object) -> int:
        task = next(iter(context.running._jobs.values()))
        assert (task.kind, task.about) == (UPKEEP, ("much",))
        seen.append(id(task))
        return BITE if len(seen) < 3 else 0

    monkeypatch.setattr(
        "service.workers.upkeep.retention.limits_of_all",
        lambda _: [Limit(name="much", bite=bite)],
    )
    run_retention(context)
    assert len(seen) == 3
    assert not context.running.of_kind(UPKEEP)
