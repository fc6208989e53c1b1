"""Real looks at drawn windows, over a real store, and the CPU and memory that each takes."""

import resource
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from fastapi.testclient import TestClient

from service.app import create_app
from service.commands.migrate import migrate
from service.formats.track import IncomingTrack, Limits, TrackRejectedError, check_track
from service.job_queue import JobQueue
from service.settings import Settings
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.estimate import run_estimate
from service.workers.processes.process import give_back, resident_mb
from tests.conftest import CAMERA
from tests.cost.drawn import HEIGHT, WIDTH, Crowd, tracks_of
from tests.service.street import PRIOR, Street
from tests.stores.rows import put_tracks

WANTED = 60
LOOK_CPU_S, LOOK_MB = 40.0, 500.0  # of a look: reference, pose and map; and beside what it has


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """The cost of a look at tracks of so many points: CPU seconds, and memory beyond that before.

    `skipped` is how many tracks it had no budget for; `error` is how it ended, if by one.
    """

    crowds: tuple[Crowd, ...]
    tracks: int
    points: int
    cpu_s: float
    peak_mb: float
    skipped: int
    error: str | None


class Looker:
    """A camera with a learned reference, and the windows that it is given one after the other."""

    def __init__(self, http: TestClient, settings: Settings) -> None:
        self._http, self._settings = http, settings
        store = Store(settings)
        self._context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))
        self._number = 0
        for form in ("points", "boxes"):  # whatever is compiled is, from here on
            self.look((), checked=True, form=form)

    def look(self, crowds: Sequence[Crowd], *, checked: bool, form: str = "points") -> Cost:
        """The cost of looks at a new camera: its reference, then the crowds and some who walk.

        Args:
            crowds: the tracks that come beside.
            checked: whether they have to pass the API's limits, or lie in the store already.
            form: of those who walk.
        """
        self._number += 1
        camera_id = f"c{self._number}"
        body = {**CAMERA, "id": camera_id, "reference_tracks": WANTED}
        self._http.post("/cameras", json=body).raise_for_status()
        end_s = time.time() - 100.0
        drawn = [
            track
            for number, crowd in enumerate(crowds)
            for track in tracks_of(crowd, end_s, f"{number}")
        ]
        if checked:
            drawn = [track for track in drawn if _is_taken(track, end_s)]
        points = sum(len(track.points) for track in drawn)
        walkers = _Walkers(self._http, self._settings, end_s)
        walkers.walk(PRIOR, 2 * WANTED, form=form)
        self._add(camera_id, [*walkers.tracks, *drawn])
        give_back()
        _forget_peak()
        before_mb, before_s, error = resident_mb(), time.process_time(), None
        try:
            run_estimate(self._context, camera_id)
        except Exception as raised:
            error = repr(raised)
        cpu_s, peak_mb = time.process_time() - before_s, _peak_mb() - before_mb
        with self._context.store.write(camera_id) as session:
            camera = session.get_one(CameraRecord, camera_id)
            skipped = [lack.values for lack in camera.missing_parts if "track_ids" in lack.values]
            session.delete(camera)
        return Cost(
            crowds=tuple(crowds),
            tracks=len(drawn),
            points=points,
            cpu_s=cpu_s,
            peak_mb=peak_mb,
            skipped=int(str(skipped[0]["tracks"])) if skipped else 0,
            error=error,
        )

    def _add(self, camera_id: str, found: Sequence[IncomingTrack]) -> None:
        with self._context.store.write(camera_id) as session:
            put_tracks(session.connection(), camera_id, found)


class _Walkers(Street):
    """A street whose people are taken down, and posted by nobody."""

    def __init__(self, http: TestClient, settings: Settings, end_s: float) -> None:
        super().__init__(http, settings)
        self.clock_s = end_s - 5.0 * 2 * WANTED
        self.tracks: list[IncomingTrack] = []

    def _post(self) -> None:
        for body in self._bodies:
            rows = np.array(body.get("points") or body["boxes"])
            self.tracks.append(check_track(f"w{body['id']}", "t", rows, _limits(time.time())))
        self._bodies.clear()
        self.close()


@contextmanager
def looker(folder: Path) -> Iterator[Looker]:
    """One over a new store in a folder."""
    settings = Settings(data_dir=folder, trainings="off", max_cameras=100_000)
    migrate(settings)
    with TestClient(create_app(settings)) as http:
        yield Looker(http, settings)


def _is_taken(track: IncomingTrack, now_s: float) -> bool:
    rows = track.points
    if track.boxes is not None:
        rows = np.column_stack([track.points[:, 0], track.boxes])
    try:
        replace(check_track(track.track_id, "t", rows, _limits(now_s)), heads=track.heads)
    except TrackRejectedError:
        return False
    return True


def _limits(now_s: float) -> Limits:
    return Limits(width=WIDTH, height=HEIGHT, now_s=now_s, max_ahead_s=60.0)


def _forget_peak() -> None:
    """Have the system count this process's peak from now on; Linux alone can."""
    Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
