"""Points to the ground and back, a second of one core: `python -m tests.benchmarks.ground`.

Through the whole application, over HTTP's bodies, of a lens that bends and with an ellipse each.
Exits with 1 below 100,000 points a second of CPU.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from fastapi.testclient import TestClient
from rich.console import Console
from rich.table import Table

from service.app import create_app
from service.commands.migrate import migrate
from service.settings import Settings
from tests.conftest import CAMERA
from tests.service.bench import Bench, moved

_POINTS, _REQUESTS = 10_000, 20
_LEAST = 100_000
_BENT = {**CAMERA["intrinsics"], "distortion": [-0.3, 0.1, 0.001, -0.002, 0.0]}


def measure(http: TestClient, path: str, points: list[list[float]]) -> tuple[float, float]:
    """Points a second of this process's CPU, and megabytes of an answer; the first is not timed."""
    http.post(path, json={"points": points}).raise_for_status()
    # The client encodes beside the server, in the same process: once, before.
    body = http.build_request("POST", path, json={"points": points}).read()
    kind = {"Content-Type": "application/json"}
    begun_s = time.process_time()
    for _ in range(_REQUESTS):
        answer = http.post(path, content=body, headers=kind)
    spent_s = time.process_time() - begun_s
    return _POINTS * _REQUESTS / spent_s, len(answer.content) / 1e6


def main() -> int:
    """Print a table of both ways."""
    rng = np.random.default_rng(0)
    feet = rng.uniform((0, 150), (1279, 719), (_POINTS, 2))
    slow = False
    table = Table("path", "points a second of a core", "MB an answer")
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(data_dir=Path(folder) / "data", allowed_hosts="testserver")
        migrate(settings)
        with TestClient(create_app(settings)) as http:
            http.post("/cameras", json={**CAMERA, "intrinsics": _BENT}).raise_for_status()
            bench = Bench(http, settings)
            bench.see(moved(tilt_deg=4), change=5)
            answer = http.post("/cameras/corner/ground", json={"points": feet.tolist()}).json()
            places = [[each["x_m"], each["y_m"]] for each in answer["points"] if each]
            places = (places * 2)[:_POINTS]
            assert answer["points"][-1]["sd_m"]
            for name, points in (("ground", feet.tolist()), ("image", places)):
                rate, size = measure(http, f"/cameras/corner/{name}", points)
                slow = slow or rate < _LEAST
                table.add_row(name, f"{rate:,.0f}", f"{size:.1f}")
    Console().print(table)
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
