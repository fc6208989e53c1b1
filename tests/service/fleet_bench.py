"""A fleet as it may stand one afternoon, written straight into a store: hundreds in seconds."""

import math
import random
import secrets
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.alerts.alerts import acknowledge_alert, open_alert
from service.cameras.cameras import CameraSpec, register_camera
from service.job_queue import JobQueue
from service.reasons import as_said
from service.settings import Settings
from service.store import references, trainings
from service.store.engines.store import Store
from service.store.estimates import EstimateRecord
from service.store.references import MaintenanceRecord
from service.store.tracks import TrackRecord, pack

STILL = ("ok", "unsure", "suspected")  # nothing is said to have moved
MOVED = {"drifting": 0.999, "suspected": 0.8, "unsure": 0.4}
LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
POSE = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1))
PLACES = (
    "Station square", "Bus gate", "North stairs", "Market hall", "Quay", "Museum door",
    "Platform 4", "School lane", "Library steps", "Footbridge", "Car park B", "Tram stop",
)  # fmt: skip


class Fleet:
    """Cameras of made-up states in a migrated store."""

    def __init__(self, settings: Settings, seed: int = 7) -> None:
        self.settings = settings
        self.store = Store(settings)
        self.queue = JobQueue(self.store.engine)
        self.random = random.Random(seed)
        self.now = datetime.now(UTC)

    def close(self) -> None:
        self.queue.close()
        self.store.close()

    def add(
        self, camera_id, name=None, state="ok", *, tracks=40, estimates=60, wanted=200,
        site="", tags=(), **drift
    ):  # fmt: skip
        """One camera; `drift` has tilt_deg, pan_deg and height_m."""
        with self.store.write() as session:
            spec = CameraSpec(
                camera_id=camera_id,
                name=name or camera_id,
                intrinsics=LENS,
                prior_pose=POSE,
                frame_rate_hz=25.0,
                walking_speed_mean_mps=1.4,
                walking_speed_sd_mps=0.1,
                reference_tracks=wanted,
                site=site,
                tags=tags,
            )
            register_camera(session, self.queue, self.settings, spec)
            for training in trainings.unfinished(session, camera_id):
                training.state, training.finished_at = "succeeded", self.now
            silent_s = 26 * 3600 if state == "no_data" else self.random.uniform(2, 400)
            session.add_all(self._tracks(camera_id, tracks, self.now.timestamp() - silent_s))
            reference = references.newest(session, camera_id)
            reference.source = "cam-" + camera_id if tracks else None
            if state in ("learning", "unconnected"):
                return
            begun = self.now - timedelta(hours=30)
            reference.ready_at, reference.data = begun, b"made up"
            reference.tracks, reference.walking_speed_mps = wanted, 1.3
            reference.to_s = begun.timestamp() - 1e6
            session.add_all(self._estimates(camera_id, reference, state, estimates, drift))

    def knock(
        self, camera_id, *, tilt_deg=3.0, kind="drift", severity="critical", by=None, drifted=None
    ):
        """What a knock comes to: estimates that tell it, and an alert, whose id is returned."""
        with self.store.write() as session:
            reference = references.newest(session, camera_id)
            drift = {"tilt_deg": tilt_deg, "pan_deg": -0.8, "height_m": -0.12}
            state = "unsure" if kind == "unsure" else "drifting"
            last = self._estimates(camera_id, reference, state, 8, drift, still=0.0)
            if drifted is not None:
                for each in last:
                    each.drifted = drifted
            session.add_all(last)
            alert = open_alert(
                session, self.settings, camera_id, kind, severity,
                {"tilt_rad": math.radians(tilt_deg)}, self.now - timedelta(minutes=9),
                reasons=as_said(f"tilt {tilt_deg:+.2f} deg"),
            )  # fmt: skip
            assert alert is not None
            if by is not None:
                acknowledge_alert(session, alert.id, by)
            return alert.id

    def tell_nothing(self, camera_id):
        """A newest estimate whose tracks cannot tell the pose."""
        with self.store.write() as session:
            reference = references.newest(session, camera_id)
            (last,) = self._estimates(camera_id, reference, "learning", 1, {}, still=0.0)
            last.identifiable, last.created_at = [], self.now
            session.add(last)

    def attend(self, camera_id, hours=1.0, began_h=0.0):
        with self.store.write() as session:
            session.add(
                MaintenanceRecord(
                    id=secrets.token_hex(16),
                    camera_id=camera_id,
                    from_at=self.now - timedelta(hours=began_h),
                    to_at=self.now + timedelta(hours=hours),
                    reason="lens",
                    requested_by=None,
                    created_at=self.now,
                    updated_at=self.now,
                )  # fmt: skip
            )

    def train(self, camera_id, share=0.4):
        with self.store.write() as session:
            (training,) = trainings.of_camera(session, camera_id, 1)
            training.state, training.steps = "running", 1000
            training.step, training.finished_at = int(1000 * share), None

    def _tracks(self, camera_id, count, newest_s):
        for n in range(count):
            ended_s = newest_s - 40.0 * (count - 1 - n)
            points = np.array([[ended_s - 8 + k, 300 + 12 * k, 400 + 9 * k] for k in range(9)])
            yield TrackRecord(
                camera_id=camera_id, source="cam-" + camera_id, track_id=str(n),
                started_s=ended_s - 8, ended_s=ended_s, points=pack(points), boxes=None,
                received_at=datetime.fromtimestamp(ended_s, UTC),
            )  # fmt: skip

    def _estimates(self, camera_id, reference, state, count, drift, still=0.7):
        tilt = math.radians(drift.get("tilt_deg", 0.0))
        pan = math.radians(drift.get("pan_deg", 0.0))
        height = drift.get("height_m", 0.0)
        angle = math.hypot(tilt, pan)
        for n in range(count):
            share = 1.0 if n >= still * count else 0.0
            noise = self.random.gauss
            yield EstimateRecord(
                camera_id=camera_id, model_id=None, prior_pose_id=reference.prior_pose_id,
                reference_id=reference.id,
                state=state if share and state != "no_data" else "ok",
                reasons=as_said("made up"),
                identifiable=["tilt", "roll", "height", "heading"],
                height_m=6.0 + height * share, tilt_rad=POSE.tilt_rad + tilt * share,
                roll_rad=POSE.roll_rad, heading_rad=pan * share,
                height_sd_m=0.03, tilt_sd_rad=0.001, roll_sd_rad=0.002, heading_sd_rad=0.002,
                covariance=np.diag([1e-6, 4e-6, 2.5e-5, 4e-6]).tolist(),
                drift_height_m=height * share + noise(0, 0.03),
                drift_tilt_rad=tilt * share + noise(0, 0.0002),
                drift_roll_rad=noise(0, 0.0003), drift_heading_rad=pan * share + noise(0, 0.0003),
                drift_angle_rad=angle * share, suspected=False,
                moved=MOVED.get(state, 0.03) if share else 0.03, moved_parameters={},
                alternatives=[], detectable={},
                drift_streak=5 if share and state not in STILL else 0,
                drifted=["tilt"] if share and state not in STILL else [],
                drift_after=None, drift_since=None, raw={},
                tracks=200, from_s=self.now.timestamp() - 9e4, to_s=self.now.timestamp(),
                newest_track_pk=1, created_at=self.now - timedelta(minutes=count - n),
            )  # fmt: skip


def afternoon(fleet: Fleet, count: int) -> None:
    """A fleet of so many: most stand still, some learn, some have moved, some see nobody."""
    for n in range(count):
        place = f"{PLACES[n % len(PLACES)]} {n // len(PLACES) + 1}"
        camera_id = place.lower().replace(" ", "-")
        roll = fleet.random.random()
        if n % 83 == 4:
            state = "drifting"
        else:
            state = "ok" if roll < 0.86 else "learning" if roll < 0.94 else "no_data"
        turned = fleet.random.choice((-1, 1)) * fleet.random.uniform(1.4, 5)
        drift = {"tilt_deg": turned, "pan_deg": -0.4 * turned} if state == "drifting" else {}
        fleet.add(camera_id, place, state, tracks=fleet.random.randrange(20, 180), **drift)
        if state == "drifting":
            fleet.knock(camera_id, tilt_deg=turned, by="Ines" if n % 3 == 0 else None)
        if n % 61 == 9:
            fleet.train(camera_id, fleet.random.random())
        if n % 97 == 13:
            fleet.attend(camera_id)


def every_state(fleet: Fleet, numbers: Iterable[int]) -> None:
    """Cameras of some numbers, twelve of which are in all states; the first three cost the most."""
    for n in numbers:
        camera_id = f"cam-{n:03}"
        turned = {"tilt_deg": 1.5 + 0.01 * n, "pan_deg": -0.5, "height_m": 0.2}
        match n % 12:
            case 0:  # moved, and the newest people cannot tell how far
                fleet.add(camera_id, state="drifting", **turned)
                fleet.knock(camera_id, tilt_deg=2.0)
                fleet.tell_nothing(camera_id)
            case 1:  # learning, with somebody there since a while
                fleet.add(camera_id, state="learning", tracks=30)
                fleet.attend(camera_id, hours=2.0, began_h=0.1)
            case 2:
                fleet.add(camera_id, state="drifting", **turned)
                fleet.knock(camera_id, severity="warning", by="Ines")
            case 3:
                fleet.add(camera_id)
            case 4:
                fleet.add(camera_id, state="no_data")
            case 5:  # learning, and somebody was there
                fleet.add(camera_id, state="learning", tracks=60)
                fleet.attend(camera_id, hours=-0.2, began_h=0.4)
            case 6:
                fleet.add(camera_id, state="drifting", **turned)
                fleet.knock(camera_id, kind="clock")
            case 7:
                fleet.add(camera_id)
                fleet.attend(camera_id, hours=2.0)
            case 8:
                fleet.add(camera_id, state="learning", tracks=5)
                fleet.train(camera_id)
            case 9:
                fleet.add(camera_id)
                fleet.knock(camera_id, kind="unsure", severity="warning")
            case 10:
                fleet.add(camera_id, state="suspected", **turned)
            case _:  # nothing told, no alert
                fleet.add(camera_id)
                fleet.tell_nothing(camera_id)
