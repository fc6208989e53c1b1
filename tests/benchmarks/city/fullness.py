"""What a camera costs that has all the tracks that may be kept: on a file, and on a server.

    python -m tests.benchmarks.city.fullness

Reading what a look is made of with 600 tracks stored, and with 20,000; then an hour's retention at
a track each 5 s, which is 720 tracks too many, with every other limit of the camera asked.
"""

import json
import sys
import tempfile
import time
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median

import numpy as np
from sqlalchemy import insert

from service.commands.postgresql.moving import move
from service.estimation.evidence import load_evidence
from service.settings import Settings
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, pack
from service.workers.upkeep import retention
from tests.benchmarks.city.seeding import camera_id, seed_file
from tests.conftest import track
from tests.stores.server import Server

_SOME, _KEPT, _OF_AN_HOUR = 600, 20_000, 720
_APART_S = 5.0
_TIMES = 9


def main() -> None:
    """Measure, and print JSON."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="surefoot-full-")))
        server = Server(durable=True)
        server.start()
        stack.callback(server.remove)
        seed_file(folder / "file", 1)
        of_server = Settings(
            data_dir=folder / "server",
            database_url=server.url(),
            secret_key="MDEyMzQ1Njc4OTAxMjM0NTY3ODkwMTIzNDU2Nzg5MDE=",
        )
        of_file = Settings(data_dir=folder / "file")
        move(of_file.database_path, of_server, lambda *_: None)
        found = {"SQLite": measure(of_file), "PostgreSQL": measure(of_server)}
    json.dump(found, sys.stdout, indent=1)
    sys.stdout.write("\n")


def measure(settings: Settings) -> dict[str, float]:
    """Milliseconds of each, and how many rows were deleted."""
    store, found, stored = Store(settings), {}, 0
    for count in (_SOME, _KEPT, _KEPT + _OF_AN_HOUR):
        _add(store, stored, count)
        stored = count
        found[f"reading_a_look_of_{count}_ms"] = 1000 * _reading_s(store, settings)
    began_s, rows = time.monotonic(), 0
    for limit in retention.limits_of_camera(settings, camera_id(0)):
        bite = retention.BITE
        while bite >= retention.BITE:
            bite = store.write_if_needed(camera_id(0), limit.bite)
            rows += bite
    found["retention_of_an_hour_ms"] = 1000 * (time.monotonic() - began_s)
    found["rows_deleted"] = rows
    store.close()
    return {name: round(value, 1) for name, value in found.items()}


def _add(store: Store, first: int, end: int) -> None:
    """Tracks by their numbers; those of higher ones came later, and the last of all just now."""
    now, points = datetime.now(UTC), pack(np.array(track("0")["points"]))
    rows = []
    for number in range(first, end):
        came = now - timedelta(seconds=_APART_S * (_KEPT + _OF_AN_HOUR - number))
        rows.append(
            {
                "camera_id": camera_id(0),
                "source": "city",
                "track_id": str(number),
                "started_s": came.timestamp() - 8,
                "ended_s": came.timestamp(),
                "points": points,
                "received_at": came,
                "first_px": 0,
            }
        )
    with store.write(camera_id(0)) as session:
        session.execute(insert(TrackRecord), rows)


def _reading_s(store: Store, settings: Settings) -> float:
    took = []
    for _ in range(_TIMES):
        began_s = time.monotonic()
        with store.read() as session:
            assert load_evidence(session, settings, camera_id(0)) is not None
        took.append(time.monotonic() - began_s)
    return median(took)


if __name__ == "__main__":
    main()
