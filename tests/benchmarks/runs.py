"""CPU of an estimation run at a full window of a stationary camera, by kind of run.

    python -m tests.benchmarks.runs

First the job alone, in this process, over a real store, medians of 20: a monitor run with 1, 5 and
10 new tracks, a run that scores the whole window (what a monitor run was before the scores were
stored), and a full estimate. Then full estimates of tracks in other forms, and a run all
told: the CPU of a real service with its workers, from new tracks posted to the end of the run,
growth of the map included. Limits are for a quiet machine: other processes on its cores slow it
down, so compare the ratios.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import patch

import psutil
from fastapi.testclient import TestClient
from rich.console import Console

from service.app import create_app
from service.commands.migrate import migrate
from service.settings import Settings
from service.store import monitor_states
from service.store.cameras import CameraRecord
from service.workers.estimate import run_estimate
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for
from tests.service.street import PRIOR, Street

REFERENCE, WINDOW, NEW, RUNS = 200, 400, 10, 20
MONITOR_NEW = (1, 5, 10)  # new tracks of a monitor run
MONITOR_MS, FULL_MS = 8.0, 65.0  # of CPU: limit of a monitor run; a full estimate when that began
FORMS = {"boxes": 100.0, "long": 200.0}  # ms of CPU of a full estimate of other tracks
LIMIT_S, _POSTS = 0.2, 10  # of CPU, for a run all told; of so many posts


def main() -> None:
    """Measure monitor runs, full estimates and a run all told."""
    console = Console(width=110)
    with _street() as street:
        monitor_ms, whole_ms, full_ms = _runs(street)
    for new, ms in monitor_ms.items():
        console.print(
            f"monitor run, {new} new of {WINDOW}: {ms:.1f} ms of CPU, {ms / MONITOR_MS:.2f} of the "
            f"limit of {MONITOR_MS:g} ms; {ms / whole_ms:.2f} of a run that scores the whole "
            f"window ({whole_ms:.1f} ms), {ms / full_ms:.3f} of a full estimate"
        )
    console.print(f"full estimate: {full_ms:.0f} ms of CPU, {full_ms / FULL_MS:.2f} of {FULL_MS:g}")
    for form, limit_ms in FORMS.items():
        with _street() as street:
            ms = _full_ms(street, form)
        console.print(
            f"full estimate, {form}: {ms:.0f} ms of CPU, {ms / limit_ms:.2f} of the limit"
        )
    cpu_s, took_s = _all_told()
    console.print(
        f"a run all told: {cpu_s:.2f} CPU-s, {cpu_s / LIMIT_S:.2f} of the limit of "
        f"{LIMIT_S:g} CPU-s; {took_s:.2f} s from the post to the end of the run"
    )


@contextmanager
def _street() -> Iterator[Street]:
    """A street before a service without workers, in a folder of its own."""
    os.environ["SUREFOOT_ALLOWED_HOSTS"] = "testserver"  # TestClient's name
    with tempfile.TemporaryDirectory(prefix="surefoot-runs-") as folder:
        settings = Settings(data_dir=Path(folder) / "data")
        migrate(settings)
        with TestClient(create_app(settings)) as http:
            _register(http)
            street = Street(http, settings)
            yield street
            street.close()


def _fill(street: Street, form: str) -> None:
    """Have a reference learned and a window filled."""
    for count in (REFERENCE, WINDOW):
        _walk(street, count, form)
        run_estimate(street.context, "corner")


def _runs(street: Street) -> tuple[dict[int, float], float, float]:
    """Milliseconds of CPU: monitor runs by new tracks, a whole window's, a full estimate's."""
    _fill(street, "points")
    monitor_ms: dict[int, list[float]] = {new: [] for new in MONITOR_NEW}
    whole_ms, full_ms = [], []
    for _ in range(RUNS):
        full_ms.append(_run_ms(street, 1, "points", kind="full"))
        for new, found in monitor_ms.items():
            found.append(_run_ms(street, new, "points", kind="monitor"))
        with street.context.store.write() as session:
            monitor_states.forget(session)
        whole_ms.append(_run_ms(street, 5, "points", kind="whole"))
    medians = {new: statistics.median(found) for new, found in monitor_ms.items()}
    return medians, statistics.median(whole_ms), statistics.median(full_ms)


def _full_ms(street: Street, form: str) -> float:
    """Median milliseconds of CPU of a full estimate of tracks in a form."""
    _fill(street, form)
    return statistics.median(_run_ms(street, NEW, form, kind="full") for _ in range(RUNS // 2))


def _run_ms(street: Street, new: int, form: str, *, kind: str) -> float:
    """Milliseconds of CPU of a run with so many new tracks, which has to be of a kind."""
    _walk(street, new, form)
    with street.context.store.write() as session:
        session.get_one(CameraRecord, "corner").full_estimate_asked = kind == "full"
    before = street.pose()
    with patch("service.workers.estimate._grow_unless_failed"):  # growth is part of "all told"
        began_s = time.process_time()
        run_estimate(street.context, "corner")
        took_ms = 1000 * (time.process_time() - began_s)
    after = street.pose()
    assert (after["updated_at"] != before["updated_at"]) == (kind == "full")
    assert after["checked_at"] > before["checked_at"]
    return took_ms


def _walk(street: Street, count: int, form: str) -> None:
    if form == "long":
        street.keep_to_lanes(PRIOR, count)
    else:
        street.walk(PRIOR, count, form=form)


def _all_told() -> tuple[float, float]:
    """Seconds of CPU of a service and its workers for each estimate, and until it is served."""
    with tempfile.TemporaryDirectory(prefix="surefoot-runs-") as folder:
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
            for _ in range(_POSTS):
                posted_s = time.monotonic()
                street.walk(PRIOR, NEW)
                at = datetime.now(UTC)
                wait_for(lambda at=at: _is_checked(street, at), every_s=0.1)
                took_s.append(time.monotonic() - posted_s)
                time.sleep(1.0)  # the growth and the reconcile are through
            cpu_s = _cpu_s(service) - cpu_s - idle_s * (time.monotonic() - began_s)
        finally:
            service.stop()
    return cpu_s / _POSTS, statistics.median(took_s)


def _register(http: TestClient) -> None:
    http.post("/cameras", json={**CAMERA, "reference_tracks": REFERENCE}).raise_for_status()


def _cpu_s(service: RunningService) -> float:
    """Of the service and all its processes, those that have ended among them."""
    first = psutil.Process(service.process.pid)
    times = [each.cpu_times() for each in (first, *first.children(recursive=True))]
    return sum(t.user + t.system + t.children_user + t.children_system for t in times)


def _is_checked(street: Street, since: datetime) -> bool:
    checked_at = street.pose()["checked_at"]
    return checked_at is not None and datetime.fromisoformat(checked_at) > since


def _has_newest(street: Street) -> bool:
    newest = street.pose()["to"]
    return newest is not None and datetime.fromisoformat(newest).timestamp() >= street.clock_s - 1


if __name__ == "__main__":
    main()
