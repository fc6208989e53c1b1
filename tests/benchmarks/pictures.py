"""What it costs to ask hundreds of cameras for their pictures, and to compare them.

    python -m tests.benchmarks.pictures FOLDER [--cameras 500] [--every-min 5]

Of the photographs of a folder, some in all weathers, served by this process. After each camera's
first picture, which begins its gallery, one more of each is measured: CPU of all processes of the
service beside what they take at rest, for a picture and, of one an hour, as a share of a core.
"""

import argparse
import json
import sys
import tempfile
import threading
import time
from collections import Counter
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import psutil

from service.commands.migrate import migrate
from service.settings import Settings
from service.store.engines.files import connected
from studies.pictures.trials import photographs
from studies.pictures.weather import drawn, lens, taken
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for

_PLACES, _WEATHERS = 12, 8
_REST_S = 60.0


class Cameras(ThreadingHTTPServer):
    """Cameras `/<place>/<number>.jpg`, each of whose pictures is of another weather."""

    daemon_threads = True

    def __init__(self, folder: Path) -> None:
        super().__init__(("127.0.0.1", 0), _Answer)
        found, draw = photographs([folder]), np.random.default_rng(0)
        names = list(found)[:: max(1, len(found) // _PLACES)][:_PLACES]
        others = list(found.values())
        self.pictures = [
            [_jpeg(taken(found[name], drawn(draw), others)[0]) for _ in range(_WEATHERS)]
            for name in names
        ]
        self.asked: Counter[str] = Counter()


class _Answer(BaseHTTPRequestHandler):
    server: Cameras

    def do_GET(self) -> None:
        place = int(self.path.split("/")[1])
        self.server.asked[self.path] += 1
        body = self.server.pictures[place][self.server.asked[self.path] % _WEATHERS]
        self.send_response(200)
        self.send_header("Content-Type", "image/jpeg")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


def _jpeg(grey: np.ndarray) -> bytes:
    colour = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    return bytes(cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, 85])[1])


def main() -> None:
    """Register, serve, wait for two pictures of each camera, and print what the second took."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("folder", type=Path, help="of photographs")
    asked.add_argument("--cameras", type=int, default=500)
    asked.add_argument("--every-min", type=float, default=5.0)
    wanted = asked.parse_args()
    cameras = Cameras(wanted.folder)
    threading.Thread(target=cameras.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory(prefix="surefoot-pictures-") as folder:
        settings = Settings(
            data_dir=Path(folder) / "data",
            port=free_port(),
            trainings="off",
            caller_rate=0,
            snapshots="features",
            snapshot_every_min=wanted.every_min,
            snapshot_allow="127.0.0.1/32",
        )
        migrate(settings)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            report = _measured(service, settings, cameras, wanted.cameras)
        finally:
            service.stop()
            cameras.shutdown()
    json.dump(report, sys.stdout, indent=1)
    sys.stdout.write("\n")


def _measured(
    service: RunningService, settings: Settings, cameras: Cameras, count: int
) -> dict[str, object]:
    wait_for(service.ready)
    rest = _cpu_s(service)
    time.sleep(_REST_S)
    rest = (_cpu_s(service) - rest) / _REST_S
    own, where = lens(), f"http://127.0.0.1:{cameras.server_address[1]}"
    intrinsics = {name: getattr(own, name) for name in ("fx", "fy", "cx", "cy", "width", "height")}
    for number in range(count):
        url = f"{where}/{number % len(cameras.pictures)}/{number}.jpg"
        named = {"id": f"seen-{number}", "intrinsics": intrinsics, "snapshot_url": url}
        service.http.post("/cameras", json={**CAMERA, **named}).raise_for_status()
    wait_for(lambda: _compared(settings)[0] == count, timeout_s=1800, every_s=1)
    begun, cpu_s, before = time.time(), _cpu_s(service), cameras.asked.total()
    wait_for(lambda: cameras.asked.total() >= before + count, timeout_s=1800, every_s=1)
    wait_for(lambda: service.http.get("/readyz").json()["queue_lag_s"] == 0, timeout_s=600)
    lasted_s, pictures = time.time() - begun, cameras.asked.total() - before
    each_s = (_cpu_s(service) - cpu_s - rest * lasted_s) / pictures
    _, matched, moved = _compared(settings)
    return {
        "cameras": count,
        "pictures": pictures,
        "lasted_s": round(lasted_s),
        "newest_matched": matched,
        "said_to_have_moved": moved,
        "cpu_s_a_picture": round(each_s, 3),
        "core_percent_hourly": round(100 * each_s * count / 3600, 2),
        "core_percent_at_rest": round(100 * rest, 2),
    }


def _compared(settings: Settings) -> tuple[int, int, int]:
    """How many cameras have a compared picture, how many of these match, how many have moved."""
    with connected(settings.database_path) as database:
        row = database.execute(
            "SELECT count(*), coalesce(sum(turn IS NOT NULL), 0), coalesce(sum(has_moved), 0) "
            "FROM pictures"
        ).fetchone()
    return tuple(row)


def _cpu_s(service: RunningService) -> float:
    """CPU seconds of the service's processes, with those that they started and that have ended."""
    first = psutil.Process(service.process.pid)
    return sum(sum(each.cpu_times()[:4]) for each in (first, *first.children(recursive=True)))


if __name__ == "__main__":
    main()
