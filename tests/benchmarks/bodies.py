"""What the worst bodies of 32 MiB cost the API: `python -m tests.benchmarks.bodies`.

Each goes to a real service, which starts anew for it: seconds until the answer, the peak of memory,
and the longest wait of `/healthz` meanwhile. No process may take more than `--limit-mb`.
With SUREFOOT_TEST_DATABASE=postgresql it runs on a server of its own.
"""

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import httpx
import psutil
from rich.console import Console
from rich.table import Table

from service.settings import Settings
from tests.benchmarks.parts.health_probe import probing
from tests.conftest import CAMERA
from tests.running import RunningService, free_port
from tests.stores import databases

SIZE = 32 * 2**20
JSON, NDJSON, CSV = "application/json", "application/x-ndjson", "text/csv"
_EVERY_S = 0.02
_QUERY = "?frame_rate_hz=25&started_at=2026-11-01T00:00:00Z"


def filled(before: str, unit: str, after: str) -> Callable[[], bytes]:
    """A body of one text again and again, as large as may be."""

    def made() -> bytes:
        times = (SIZE - len(before) - len(after)) // len(unit.encode())
        return before.encode() + unit.encode() * times + after.encode()

    return made


def honest() -> bytes:
    """Tracks of 300 points, as many as there is room for; the newest ends now."""
    end_s, tracks, size = time.time(), [], 0
    while size < SIZE - 20_000 and len(tracks) < 5_000:
        start_s = end_s - 40 - len(tracks)
        points = ((start_s + n / 10, 900 + n / 10, 600 + n / 7) for n in range(300))
        rows = ",".join(f"[{time_s:.3f},{u},{v:.3f}]" for time_s, u, v in points)
        tracks.append(f'{{"id":"{len(tracks)}","points":[{rows}]}}')
        size += len(tracks[-1]) + 1
    return f'{{"source":"honest","tracks":[{",".join(tracks)}]}}'.encode()


def honest_lines() -> bytes:
    """MOTChallenge text of people in turn, of 400 frames each."""
    lines = (
        f"{n % 400 + 1},{n // 400 + 1},{900 + n % 400 / 10:.2f},500.00,40.00,100.00,1,-1,-1,-1"
        for n in range(450_000)
    )
    return "\n".join(lines).encode()[:SIZE]


def ids() -> bytes:
    """A track a line, of cars."""
    return b"\n".join(b"1,%d,1,1,1,1,1,2,1," % n + b"1" * 40 for n in range(500_000))[:SIZE]


_HEAD = '{"tracks": ['
_LISTS = "[]," * 9_999
_TRACK = '{"id":"1","points":[' + "[1,1,1]," * 9_999
BODIES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "csv x\\r": (CSV, filled("", "x\r", "")),
    "csv x\\n": (CSV, filled("", "x\n", "")),
    "csv commas": (CSV, filled("1,", "1,", "\n")),
    "csv short lines": (CSV, filled("", "1,1,1,1,1,1\n" + "1" * 50 + "\n", "")),
    "csv ids": (CSV, ids),
    "csv cells": (CSV, filled("", "1," * 499 + "\n", "")),
    "csv honest": (CSV, honest_lines),
    "source": (JSON, filled('{"source": "', "a", '", "tracks": []}')),
    "source escapes": (JSON, filled('{"source": "', "\\n", '", "tracks": []}')),
    "name": (JSON, filled('{"', "a", '": 1, "tracks": []}')),
    "names": (JSON, filled("{", '"a":1,', '"tracks": []}')),
    "tracks of 1": (JSON, filled(_HEAD, "1,", "1]}")),
    "tracks of lists": (JSON, filled('{"tracks": [[', "[],", "1]]}")),
    "tracks of objects": (JSON, filled(_HEAD, "{},", "{}]}")),
    "one deep list": (JSON, filled('{"tracks": ', "[", "")),
    "objects in each other": (JSON, filled('{"tracks": ', '{"a":', "")),
    "long tracks": (JSON, filled(_HEAD, '{"a":[' + "[]," * 690_000 + "1]},", "1]}")),
    "points of lists": (JSON, filled(_HEAD, '{"id":"1","points":[' + _LISTS + "1]},", "1]}")),
    "last row wrong": (JSON, filled(_HEAD, _TRACK + '[1,1,"x"]]},', "1]}")),
    "last row short": (JSON, filled(_HEAD, _TRACK + "[1,1]]},", "1]}")),
    "NaN": (JSON, filled('{"tracks": [{"id":"1","points":[[', "NaN,", "NaN]]}]}")),
    "NaN at the end": (JSON, filled(_HEAD, _TRACK + "[1,1,NaN]]},", "1]}")),
    "long numbers": (JSON, filled(_HEAD, '{"id":"1","points":[[' + "1" * 4_000 + "]]},", "1]}")),
    "wide text": (JSON, filled('{"source": "', "\u00e9", '", "tracks": []}')),
    "spaces": (JSON, filled("", " ", '{"tracks": []}')),
    "ndjson 11": (NDJSON, filled("", "11\n", "")),
    "ndjson empty": (NDJSON, filled("", "\n", "")),
    "ndjson one line": (NDJSON, filled("", "[", "\n")),
    "ndjson lists": (NDJSON, filled("", '{"id":"1","points":[' + "[]," * 9_999 + "1]}\n", "")),
    "honest": (JSON, honest),
}  # fmt: skip


def memory_mb(pid: int) -> float:
    """The peak of memory of a process and of those that it started."""
    peaks = [0.0]
    for each in (psutil.Process(pid), *psutil.Process(pid).children(recursive=True)):
        status = Path(f"/proc/{each.pid}/status").read_text()
        peaks.append(int(status.partition("VmHWM:")[2].split()[0]) / 1024)
    return sum(peaks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """The cost of a body: its answer, memory in MB of the API before and at its peak.

    Of the longest wait of `/healthz`, what a server waited just after that has nothing to do.
    """

    answer: str
    took_s: float
    before_mb: float
    peak_mb: float
    health_ms: float
    idle_ms: float


def measure(settings: Settings, limit_mb: int, kind: str, body: bytes) -> Cost:
    """Post a body to a service of its own, and ask from another process how it is meanwhile."""
    running = RunningService(settings)
    running.start()
    try:
        running.http.post("/cameras", json={**CAMERA, "id": "c0"}).raise_for_status()
        limit = limit_mb * 2**20
        resource.prlimit(running.process.pid, resource.RLIMIT_AS, (limit, limit))
        with probing(settings.port, _EVERY_S) as ended:
            before_mb, begun_s = memory_mb(running.process.pid), time.perf_counter()
            try:
                answer = httpx.post(
                    f"{running.url}/cameras/c0/tracks{_QUERY}",
                    content=body, headers={"Content-Type": kind}, timeout=120,
                )  # fmt: skip
                said = f"{answer.status_code} {answer.text[-70:]}" if answer.is_error else "202"
            except httpx.HTTPError as error:
                said = type(error).__name__
            took_s = time.perf_counter() - begun_s
            worst = max(ended(), key=lambda probe: probe.health_s)
        return Cost(
            answer=said,
            took_s=took_s,
            before_mb=before_mb,
            peak_mb=memory_mb(running.process.pid),
            health_ms=1e3 * worst.health_s,
            idle_ms=1e3 * worst.idle_s,
        )
    finally:
        running.kill()


def main() -> None:
    """Print a line a body."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of bodies; all of them if none is given")
    parser.add_argument("--limit-mb", type=int, default=6_000)
    asked = parser.parse_args()
    table = Table("body", "answer", "s", "MB before", "MB peak", "/healthz ms", "idle ms")
    for name, (kind, made) in BODIES.items():
        if asked.names and name not in asked.names:
            continue
        with (
            tempfile.TemporaryDirectory() as folder,
            databases.fresh(Path(folder), workers=0, port=free_port()) as settings,
        ):
            cost = measure(settings, asked.limit_mb, kind, made())
        numbers = (cost.took_s, cost.before_mb, cost.peak_mb, cost.health_ms, cost.idle_ms)
        row = [f"{number:.2f}" if number < 10 else f"{number:.0f}" for number in numbers]
        sys.stderr.write(f"{name}: {cost.answer} {' '.join(row)}\n")
        table.add_row(name, cost.answer, *row)
    Console().print(table)


if __name__ == "__main__":
    main()
