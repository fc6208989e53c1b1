"""What a service with hundreds of cameras costs that nobody posts to.

    python -m tests.benchmarks.idle [--cameras 500] [--minutes 2]

CPU of each process as a share of one core, memory, and how long it takes until it answers.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import psutil

from service.commands.migrate import migrate
from service.settings import Settings
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port, wait_for

_SETTLE_S = 30.0
_TRACKS = 20


def main() -> None:
    """Seed, serve, wait, and print what that took."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cameras", type=int, default=500)
    asked.add_argument("--minutes", type=float, default=2.0)
    wanted = asked.parse_args()
    with tempfile.TemporaryDirectory(prefix="surefoot-idle-") as folder:
        settings = Settings(
            data_dir=Path(folder) / "data",
            port=free_port(),
            trainings="off",
            caller_rate=0,
        )
        migrate(settings)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            seed(service, wanted.cameras)
            service.stop()
            service = RunningService(settings, forked=False)
            begun = time.monotonic()
            service.start()
            answered_s = time.monotonic() - begun
            wait_for(service.ready)
            time.sleep(_SETTLE_S)
            report = shares(service.process.pid, 60 * wanted.minutes)
        finally:
            service.stop()
    report["answers_after_s"] = round(answered_s, 2)
    json.dump(report, sys.stdout, indent=1)
    sys.stdout.write("\n")


def seed(service: RunningService, cameras: int) -> None:
    """Cameras with some people each, all of whom have been looked at."""
    for n in range(cameras):
        body = {**CAMERA, "id": f"idle-{n}"}
        service.http.post("/cameras", json=body).raise_for_status()
        tracks = [track(f"{k}", start_s=time.time() - 600 + 20 * k) for k in range(_TRACKS)]
        path, body = f"/cameras/idle-{n}/tracks", {"source": "idle", "tracks": tracks}
        service.http.post(path, json=body).raise_for_status()
    wait_for(lambda: service.http.get("/readyz").json()["queue_lag_s"] == 0, timeout_s=600)


def shares(pid: int, lasts_s: float) -> dict[str, object]:
    """Per cent of a core and MB of a process and those that it started, over a while."""
    first = psutil.Process(pid)
    processes = {"serve": first} | {
        " ".join(child.cmdline()[3:6]): child for child in first.children(recursive=True)
    }
    before = {name: sum(process.cpu_times()[:2]) for name, process in processes.items()}
    time.sleep(lasts_s)
    return {
        name: {
            "core_percent": round(100 * (sum(process.cpu_times()[:2]) - before[name]) / lasts_s, 2),
            "rss_mb": round(process.memory_info().rss / 2**20),
        }
        for name, process in processes.items()
    }


if __name__ == "__main__":
    main()
