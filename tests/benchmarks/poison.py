"""How soon a knock is told beside a poisoned camera: `python -m tests.benchmarks.poison`.

Two cameras of one worker have learned their streets. Six points over 30 days and over 20 years are
refused over HTTP and put into the store of one, as a store from elsewhere may hold them; more
people wake its look. Then the other is turned by 8 deg. Exits with 1 beyond the limits.
With SUREFOOT_TEST_DATABASE=postgresql it runs on a server of its own.
"""

import argparse
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil

from service.formats.track import IncomingTrack
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for
from tests.service.street import PRIOR, Street
from tests.stores import databases
from tests.stores.rows import put_tracks

KNOCKED = replace(PRIOR, tilt_rad=PRIOR.tilt_rad + math.radians(8))
TOLD_S, WORKER_MB = 10.0, 1_000.0
_DAYS = (30, 20 * 365)
_REST_S = 30.0  # after the looks that learned, so that none waits for a camera's next turn


def learned(running: RunningService, camera_id: str) -> Street:
    """The street of a camera whose reference is ready."""
    body = {**CAMERA, "id": camera_id, "reference_tracks": 100}
    running.http.post("/cameras", json=body).raise_for_status()
    street = Street(running.http, running.settings)
    street.camera_id = camera_id
    street.keep_to_lanes(PRIOR, 160)
    wait_for(lambda: street.pose().get("reference", {}).get("state") == "ready")
    return street


def poison(running: RunningService, camera_id: str, days: float) -> str:
    """Put six points over so many days into the store; what HTTP says of the same."""
    ended_s = time.time() - 100.0
    time_s = np.linspace(ended_s - 86_400.0 * days, ended_s, 6)
    rows = np.column_stack([time_s, np.linspace(300, 900, 6), np.linspace(500, 520, 6)])
    body = {"tracks": [{"id": f"posted-{days}", "points": rows.tolist()}]}
    answer = running.http.post(f"/cameras/{camera_id}/tracks", json=body)
    store = Store(running.settings)
    stored = IncomingTrack(source="default", track_id=f"stored-{days}", points=rows)
    with store.write(camera_id) as session:
        put_tracks(session.connection(), camera_id, [stored])
    store.close()
    return f"{answer.status_code} {answer.json()['errors'][0]['reason'].partition(':')[0]}"


def knock(running: RunningService, streets: dict[str, Street]) -> tuple[float, float]:
    """Seconds until the other's alert after its first tracks; the worker's most memory in MB."""
    worker, most_mb = psutil.Process(running.worker_pid()), 0.0
    streets["poisoned"].keep_to_lanes(PRIOR, 20)  # its look begins
    begun_s, told_s = time.monotonic(), math.inf
    streets["other"].keep_to_lanes(KNOCKED, 60)
    while (now_s := time.monotonic() - begun_s) < 60.0 and (told_s == math.inf or now_s < 20.0):
        most_mb = max(most_mb, worker.memory_info().rss / 1e6)
        alerts = running.http.get("/alerts").json()["items"]
        if told_s == math.inf and any(alert["camera_id"] == "other" for alert in alerts):
            told_s = now_s
        time.sleep(0.05)
    return told_s, most_mb


def main() -> int:
    """Print what was told when, with the poison or without it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without", action="store_true", help="the same without the poison")
    asked = parser.parse_args()
    values = {"port": free_port(), "workers": 1, "trainings": "off"}
    with (
        tempfile.TemporaryDirectory() as folder,
        databases.fresh(Path(folder), **values) as settings,
    ):
        running = RunningService(settings, forked=False)
        running.start()
        try:
            wait_for(running.ready)
            streets = {name: learned(running, name) for name in ("poisoned", "other")}
            for days in () if asked.without else _DAYS:
                said = poison(running, "poisoned", days)
                sys.stdout.write(f"six points over {days} days: {said} by HTTP; stored by hand\n")
            time.sleep(_REST_S)
            told_s, worker_mb = knock(running, streets)
            pose = streets["poisoned"].pose()
        finally:
            running.stop()
    sys.stdout.write(f"told after {told_s:.1f} s (limit {TOLD_S:.0f}); ")
    sys.stdout.write(f"worker at most {worker_mb:.0f} MB (limit {WORKER_MB:.0f}); ")
    sys.stdout.write(f"the poisoned camera: {pose['state']}\n")
    return int(told_s > TOLD_S or worker_mb > WORKER_MB)


if __name__ == "__main__":
    sys.exit(main())
