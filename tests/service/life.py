"""A service that lives: cameras over real files, people who walk before them, jobs by hand."""

import shutil
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from fastapi.testclient import TestClient
from PIL import Image

from models.geometry.pose import CameraPose
from models.pose import CameraSite
from models.reasons import Reason, TracksCode
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe_each
from models.walking.reference_learning import learn_speed_reference
from models.walking.speed_reference import SpeedReference
from service.alerts.staleness import StaleWatch
from service.app import create_app
from service.estimate_queue import finish_run, start_run
from service.estimation.estimates import save_estimate
from service.estimation.evidence import Evidence, load_evidence
from service.estimation.learning import load_reference_period, save_reference
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import tracks, trainings
from service.store.engines.store import Store
from service.training import begin_training, end_training, publish_model
from service.workers.context import JobContext
from service.workers.estimate import run_estimate
from service.workers.upkeep.reconciliation import run_reconcile
from service.workers.upkeep.retention import run_retention
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, made_up, moved
from tests.service.shifted_clock import ShiftedClock
from tests.service.street import LENS

# Where a camera may really stand.
PLACES = {
    "prior": PRIOR,
    "nudged": moved(tilt_deg=1.5),
    "knocked": moved(tilt_deg=6.6, roll_deg=-2.0),
    "raised": moved(height_m=1.2),
    "far": moved(tilt_deg=14.0),
}
WANTED = 10  # people of a reference
BANK = 40  # different walks of each place


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """An estimate job that has read what it needs, and not stored what it came to."""

    camera_id: str
    evidence: Evidence | None
    newest_pk: int | None


class Life:
    """The service over one folder, its clock, and where each of its cameras really stands."""

    def __init__(self, folder: Path, migrated: Path, clock: ShiftedClock) -> None:
        shutil.copytree(migrated, folder / "data")
        self.settings = Settings(
            data_dir=folder / "data",
            epochs=1,
            window_tracks=20,
            snapshots="pictures",
            group_cameras=2,
            keep_days=20.0,
        )
        self.clock = clock
        self.stands: dict[str, str] = {}
        self.acknowledged: dict[str, dict[str, float]] = {}
        self.count = 0
        self.start()

    def start(self) -> None:
        self.store = Store(self.settings)
        self.queue = JobQueue(self.store.engine)
        self.context = JobContext(settings=self.settings, store=self.store, queue=self.queue)
        self.stale = StaleWatch()
        self.http = TestClient(create_app(self.settings))
        self.http.__enter__()

    def stop(self) -> None:
        self.http.__exit__(None, None, None)
        self.queue.close()
        self.store.close()

    def call(self, method: str, path: str, *may: int, **more: Any) -> httpx.Response:
        """An answer; it has to be a success, or a refusal that is foreseen."""
        answer: httpx.Response = self.http.request(method, path, **more)
        assert answer.is_success or answer.status_code in may, (method, path, answer.text)
        return answer

    def register(self, camera_id: str) -> None:
        body = {**CAMERA, "id": camera_id, "name": f"The {camera_id}", "reference_tracks": WANTED}
        self.call("POST", "/cameras", json=body)
        self.stands[camera_id] = "prior"
        self.acknowledged[camera_id] = {}

    def remove(self, camera_id: str) -> None:
        self.call("DELETE", f"/cameras/{camera_id}", headers={"If-Match": "*"})
        del self.stands[camera_id], self.acknowledged[camera_id]

    def post(self, camera_id: str, people: int) -> None:
        """People who walk before a camera now, one after the other, as it really stands."""
        place = self.stands[camera_id]
        batch: list[dict[str, Any]] = []
        for n in range(people):
            self.count += 1
            walk = walks_of(place)[self.count % BANK]
            time_s = self.clock.now_s() - 0.05 * (people - n) + walk.time_s - walk.time_s[-1]
            points = np.column_stack([time_s, walk.uv]).tolist()
            batch.append({"id": f"{self.count}-{place}", "points": points})
        answer = self.call("POST", f"/cameras/{camera_id}/tracks", json={"tracks": batch}).json()
        assert answer["accepted"] == people, answer
        self.acknowledged[camera_id] |= {t["id"]: t["points"][-1][0] for t in batch}

    def really_look(self, camera_id: str) -> None:
        """The real job; there are no weights of a model to read."""
        with self.store.read() as session:
            assert trainings.newest_model(session, camera_id) is None
        run_estimate(self.context, camera_id)

    def start_run(self, camera_id: str) -> Look:
        """The job up to where it has read what it needs; a reference is learned on the way."""
        with self.store.write() as session:
            newest_pk, _ = start_run(session, camera_id)
            period = load_reference_period(session, self.settings, camera_id)
            if period is not None and period.trajectories:
                learned = CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=some_site())
                if self.stands.get(camera_id) == "far":  # what is said of it cannot be
                    values = {"tilt_rad": 0.1, "roll_rad": 0.0}
                    doubt = Reason(code=TracksCode.PRIOR_POSE_DOUBTED, values=values)
                    doubted = replace(some_site(), implausible=doubt)
                    learned = replace(learned, speed_reference=doubted)
                save_reference(session, self.settings, camera_id, period, learned)
        with self.store.read() as session:
            evidence = load_evidence(session, self.settings, camera_id)
        return Look(camera_id=camera_id, evidence=evidence, newest_pk=newest_pk)

    def finish_run(self, look: Look, unidentifiable: tuple[str, ...]) -> bool:
        """The job from there on, its numbers made up; says whether an estimate was stored."""
        record = None
        with self.store.write() as session:
            if look.evidence is not None:
                pose, change = self._seen(session, look.evidence)
                finding = made_up(look.evidence, pose, unidentifiable=unidentifiable, change=change)
                record = save_estimate(session, self.queue, self.settings, look.evidence, finding)
            finish_run(session, look.camera_id, look.newest_pk)
        return record is not None

    def _seen(self, session: Any, evidence: Evidence) -> tuple[CameraPose, int | None]:
        """Where the camera stood for the newest of the tracks, and the first of them there."""
        places = []
        for seen in evidence.tracks:
            record = session.get(tracks.TrackRecord, seen.pk)
            places.append("prior" if record is None else record.track_id.split("-")[1])
        first = len(places) - 1
        while first > 0 and places[first - 1] == places[-1]:
            first -= 1
        if len(places) - first < 3:  # too few to tell
            return PLACES[places[0]], None
        return PLACES[places[-1]], first or None

    def end_training(self, training_id: str, outcome: str) -> None:
        with self.store.write() as session:
            attempt = begin_training(session, self.settings, training_id)
            if attempt is None:
                return
            if outcome == "succeeded":
                sha = "0" * 64
                publish_model(session, self.queue, attempt, weights_sha256=sha, metrics={})
            else:
                end_training(session, attempt, outcome, "it made no progress")

    def reconcile(self) -> None:
        run_reconcile(self.context, self.stale)

    def retain(self) -> None:
        run_retention(self.context)
        before_s = self.clock.now_s() - 86_400 * self.settings.keep_days
        for camera_id, known in self.acknowledged.items():
            young = {name: ended_s for name, ended_s in known.items() if ended_s >= before_s}
            self.acknowledged[camera_id] = young

    def stored(self, camera_id: str) -> set[str]:
        with self.store.read() as session:
            return {record.track_id for record in tracks.newest(session, camera_id, 100_000)}


@lru_cache(maxsize=1)
def some_site() -> SpeedReference:
    """A reference that was really learned."""
    observations = observe_each(walks_of("prior"), LENS)
    return learn_speed_reference(observations, PRIOR, WalkConfig(speed_sd_mps=0.2), 0)


@lru_cache(maxsize=8)
def walks_of(place: str) -> tuple[Trajectory, ...]:
    """People seen from a camera that stands there."""
    rng = np.random.default_rng(sum(map(ord, place)))
    config = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
    walks = simulate_walks(LENS, repeated_pose(PLACES[place], BANK), config, rng)
    found = []
    for padded, length in zip(walks.uv, walks.lengths, strict=True):
        uv = padded[:length] + rng.normal(0, 1.0, (length, 2))
        found.append(Trajectory(time_s=0.4 * np.arange(length), uv=uv))
    return tuple(found)


@lru_cache(maxsize=1)
def still() -> bytes:
    """A picture of the camera's shape."""
    buffer = BytesIO()
    Image.new("RGB", (160, 90), (90, 90, 90)).save(buffer, "JPEG")
    return buffer.getvalue()
