"""Whether twice the workers look twice as often: `python -m tests.benchmarks.scaling`.

Copies of four learned streets, each looked at once; then each has ten new people, and workers look
at all of them, first one worker and then as many as there are cores, each time from the same store.
From the first stored estimate to the last, nobody posts. Beside it, what the cores are worth: a
loop in one process, and in as many at once. Exits with 1 below 0.9 of linear, or of that.
"""

import argparse
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path

import psutil

from models.tracks.trajectory import Trajectory
from service.settings import Settings
from service.store.engines.files import connected
from tests.benchmarks.parts.cloned import as_posted, camera_at, seed
from tests.running import RunningService, free_port, wait_for

_LIMIT = 0.9
_NEW = 10
_WAITING = "SELECT count(*) FROM cameras WHERE estimate_due_at IS NOT NULL OR estimate_tries > 0"
_MADE = "SELECT min(created_at), max(created_at), count(*) FROM estimates WHERE id > ?"
_NEWEST = "SELECT max(id) FROM estimates"


def post_people(settings: Settings, walks: list[list[Trajectory]], cameras: int) -> None:
    """Ten new people before each camera, whom no worker looks at yet."""
    service = RunningService(settings.model_copy(update={"workers": 0}), forked=False)
    service.start()
    try:
        now = time.time()
        for number in range(cameras):
            camera_id, site = camera_at(number)
            tracks = [
                as_posted(walks[site][n], f"{now:.3f}-{n}", now - 2 * (_NEW - n))
                for n in range(_NEW)
            ]
            path = f"/cameras/{camera_id}/tracks"
            service.http.post(path, json={"source": "a", "tracks": tracks}).raise_for_status()
    finally:
        service.stop()


def look(settings: Settings, workers: int) -> tuple[float, float]:
    """How often a second so many workers look until all is looked at; CPU-seconds of each look."""
    with connected(settings.database_path) as connection:
        known = connection.execute(_NEWEST).fetchone()[0]
    running = [
        subprocess.Popen(
            [sys.executable, "-m", "service.cli", "worker", "--name", f"w{n}"],
            env=settings.as_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for n in range(workers)
    ]
    try:
        processes = [psutil.Process(worker.pid) for worker in running]
        wait_for(lambda: _made(settings, known)[2] > 0)
        began_s = _cpu_s(processes)
        wait_for(lambda: _all_looked_at(settings), timeout_s=900, every_s=1.0)
        spent_s = _cpu_s(processes) - began_s
    finally:
        for worker in running:
            worker.terminate()
        for worker in running:
            worker.wait()
    first, last, count = _made(settings, known)
    took = datetime.fromisoformat(last) - datetime.fromisoformat(first)
    return (count - 1) / took.total_seconds(), spent_s / (count - 1)


def _made(settings: Settings, known: int) -> tuple[str, str, int]:
    with connected(settings.database_path) as connection:
        first, last, count = connection.execute(_MADE, (known,)).fetchone()
    return first, last, count


def _cpu_s(processes: list[psutil.Process]) -> float:
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def _all_looked_at(settings: Settings) -> bool:
    with connected(settings.database_path) as connection:
        return bool(connection.execute(_WAITING).fetchone()[0] == 0)


def loop(_: int) -> float:
    """Seconds that a loop of python's takes."""
    begun_s, total = time.monotonic(), 0
    for n in range(60_000_000):
        total += n
    return time.monotonic() - begun_s


def cores_are_worth(processes: int) -> float:
    """How much more so many processes compute than one."""
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        alone_s = pool.map(loop, [0])[0]
        together_s = pool.map(loop, range(processes), chunksize=1)
    return processes * alone_s * len(together_s) / sum(together_s)


def main() -> int:
    """Measure, and print what came of it as JSON; 1 where workers do not scale as cores do."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cameras", type=int, default=160)
    cameras: int = asked.parse_args().cameras
    most = len(os.sched_getaffinity(0))
    found: dict[str, float] = {"cameras": cameras, "workers": most}
    found["cores_are_worth"] = cores_are_worth(most)
    with tempfile.TemporaryDirectory(prefix="surefoot-scaling-") as folder:
        settings = Settings(
            data_dir=Path(folder) / "seed", port=free_port(), workers=0, trainings="off"
        )
        walks = seed(settings.model_copy(update={"workers": most}), cameras)
        post_people(settings, walks, cameras)
        look(settings, most)  # each in full, once
        post_people(settings, walks, cameras)
        for workers in (1, most):
            copied = settings.model_copy(update={"data_dir": Path(folder) / f"of-{workers}"})
            shutil.copytree(settings.data_dir, copied.data_dir)
            often_hz, cost_s = look(copied, workers)
            found[f"looks_a_second_{workers}"] = often_hz
            found[f"cpu_s_a_look_{workers}"] = cost_s
    found["times"] = found[f"looks_a_second_{most}"] / found["looks_a_second_1"]
    found["of_linear"] = found["times"] / min(most, found["cores_are_worth"])
    json.dump({name: round(value, 2) for name, value in found.items()}, sys.stdout, indent=1)
    sys.stdout.write("\n")
    return 0 if found["of_linear"] >= _LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
