"""What a refresh costs: CPU of a look at a full window of a still camera, and of all around it.

    python -m tests.benchmarks.refresh

First the job alone, in this process, over a real store: in steady state, beginning at what the last
look found, and beside it in the same run the full search of all poses. Then an estimate all told:
the CPU of a real service with its workers, from new tracks posted to the pose served, growth of the
map included. Limits are for a quiet machine: whoever else computes on its cores slows them down.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

import psutil
from fastapi.testclient import TestClient
from rich.console import Console
from sqlalchemy import delete

from service.app import create_app
from service.commands.migrate import migrate
from service.settings import Settings
from service.store.references import LastPoseRecord
from service.workers.estimate import run_estimate
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for
from tests.service.street import PRIOR, Street

REFERENCE, WINDOW, NEW, REFRESHES = 200, 400, 10, 10
FORMS = {"points": 100.0, "boxes": 100.0, "long": 200.0}  # ms of CPU that a look may take
LIMIT_S = 0.2  # of CPU, for an estimate all told


def main() -> None:
    """Measure short tracks with and without boxes, long ones, and an estimate all told."""
    console = Console(width=110)
    for form, limit_ms in FORMS.items():
        with _street() as street:
            steady_ms, full_ms = _looks(street, form)
        console.print(
            f"{form}: {steady_ms:.0f} ms of CPU a refresh, {steady_ms / full_ms:.2f} of a full "
            f"search ({full_ms:.0f} ms), {steady_ms / limit_ms:.2f} of the limit of {limit_ms:g} ms"
        )
    cpu_s, took_s = _all_told()
    console.print(
        f"an estimate all told: {cpu_s:.2f} CPU-s, {cpu_s / LIMIT_S:.2f} of the limit of "
        f"{LIMIT_S:g} CPU-s; {took_s:.2f} s from the post to the pose"
    )


@contextmanager
def _street() -> Iterator[Street]:
    """A street before a service without workers, in a folder of its own."""
    os.environ["SUREFOOT_ALLOWED_HOSTS"] = "testserver"  # TestClient's name
    with tempfile.TemporaryDirectory(prefix="surefoot-refresh-") as folder:
        settings = Settings(data_dir=Path(folder) / "data")
        migrate(settings)
        with TestClient(create_app(settings)) as http:
            _register(http)
            street = Street(http, settings)
            yield street
            street.close()


def _looks(street: Street, form: str) -> tuple[float, float]:
    """Milliseconds of CPU of a look that begins at the last one, and of a full one; medians."""
    for count in (REFERENCE, WINDOW):
        _walk(street, count, form)
        run_estimate(street.context, "corner")
    steady_ms = statistics.median(_look_ms(street, form) for _ in range(REFRESHES))
    return steady_ms, statistics.median(
        _look_ms(street, form, forgetful=True) for _ in range(REFRESHES)
    )


def _look_ms(street: Street, form: str, *, forgetful: bool = False) -> float:
    _walk(street, NEW, form)
    if forgetful:
        with street.context.store.write() as session:
            session.execute(delete(LastPoseRecord))
    began_s = time.process_time()
    run_estimate(street.context, "corner")
    took_ms = 1000 * (time.process_time() - began_s)
    assert street.pose()["tracks"] >= WINDOW
    return took_ms


def _walk(street: Street, count: int, form: str) -> None:
    if form == "long":
        street.keep_to_lanes(PRIOR, count)
    else:
        street.walk(PRIOR, count, form=form)


def _all_told() -> tuple[float, float]:
    """Seconds of CPU of a service and its workers for each estimate, and until it is served."""
    with tempfile.TemporaryDirectory(prefix="surefoot-refresh-") as folder:
        # A training takes minutes of a core, and the served pose needs none.
        settings = Settings(data_dir=Path(folder) / "data", port=free_port(), trainings="off")
        migrate(settings)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            _register(service.http)
            street = Street(service.http, service.settings)
            for count in (REFERENCE, WINDOW):
                street.walk(PRIOR, count)
            wait_for(lambda: _has_newest(street), timeout_s=60)
            time.sleep(5.0)
            idle_s = _cpu_s(service)
            time.sleep(5.0)
            idle_s = (_cpu_s(service) - idle_s) / 5.0
            took_s, began_s, cpu_s = [], time.monotonic(), _cpu_s(service)
            for _ in range(REFRESHES):
                posted_s = time.monotonic()
                street.walk(PRIOR, NEW)
                wait_for(lambda: _has_newest(street), every_s=0.1)
                took_s.append(time.monotonic() - posted_s)
                time.sleep(1.0)  # the growth and the reconcile are through
            cpu_s = _cpu_s(service) - cpu_s - idle_s * (time.monotonic() - began_s)
        finally:
            service.stop()
    return cpu_s / REFRESHES, statistics.median(took_s)


def _register(http: TestClient) -> None:
    http.post("/cameras", json={**CAMERA, "reference_tracks": REFERENCE}).raise_for_status()


def _cpu_s(service: RunningService) -> float:
    """Of the service and all its processes, those that have ended among them."""
    first = psutil.Process(service.process.pid)
    times = [each.cpu_times() for each in (first, *first.children(recursive=True))]
    return sum(t.user + t.system + t.children_user + t.children_system for t in times)


def _has_newest(street: Street) -> bool:
    newest = street.pose()["to"]
    return newest is not None and datetime.fromisoformat(newest).timestamp() >= street.clock_s - 1


if __name__ == "__main__":
    main()
