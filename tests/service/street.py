"""A street of simulated people, posted over HTTP and looked at by the real job, by hand."""

import math
import time
from typing import Any

import numpy as np

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import statures, tops_of_boxes, tops_seen
from models.pose import observe
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.trajectory import Trajectory
from service.job_queue import JobQueue
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.estimate import run_estimate
from studies.simulation.lanes import Lane, SiteConfig, draw_lanes, walk_site
from tests.conftest import CAMERA

LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)
KNOCKED = CameraPose(
    height_m=6.3, tilt_rad=math.radians(27), roll_rad=math.radians(-3), heading_rad=math.radians(40)
)

LANES = SiteConfig(aside_m=0.8, standing_share=0.0)


def known_street(http: Any, settings: Any, people: int) -> "Street":
    """A street of lanes whose reference has been learned of so many people."""
    http.post("/cameras", json={**CAMERA, "reference_tracks": people}).raise_for_status()
    street = Street(http, settings)
    street.keep_to_lanes(PRIOR, people)
    assert street.look()["reference"]["state"] == "ready"
    return street


def lately_s() -> float:
    """Whole seconds of a clock that is hours behind ours, so that nobody walks ahead of time."""
    return math.floor(time.time()) - 20_000.0


class Street:
    """People who walk past a camera one after the other, and the camera's service."""

    camera_id = "corner"
    source: str | None = None  # of their tracks; the default one's, where none is named

    def __init__(self, http: Any, settings: Any) -> None:
        self.go_on(http, settings)
        self.clock_s = lately_s()
        self.seed = 0
        self.seen: list[Trajectory] = []
        self._bodies: list[dict[str, Any]] = []
        self._lanes: list[Lane] = []

    def go_on(self, http: Any, settings: Any) -> None:
        """Be watched by a service, over its store."""
        self.http = http
        store = Store(settings)
        self.context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))

    def close(self) -> None:
        """Let go of the store."""
        self.context.queue.close()
        self.context.store.close()

    def __getstate__(self) -> dict[str, Any]:
        """The people and the settings, without the service: to be kept beside its data."""
        return {**vars(self), "http": None, "context": None, "settings": self.context.settings}

    def walk(
        self,
        pose: CameraPose,
        count: int,
        *,
        rate: float = 1.0,
        form: str = "points",
    ) -> None:
        """Post people seen from a pose; at another rate, their times are that much too short."""
        rng = self._next_rng()
        config = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
        walks = simulate_walks(LENS, repeated_pose(pose, count), config, rng)
        for padded, length in zip(walks.uv, walks.lengths, strict=True):
            uv = padded[:length] + rng.normal(0, 1.0, (length, 2))
            time_s = np.arange(1 - length, 1) * 0.4 / rate
            if form == "points":
                self._see(time_s, uv)
            else:
                self._see(time_s, uv, people_boxes(pose, uv, rng.normal(1.7, 0.07)))
        self._post()

    def cross(self, pose: CameraPose, count: int) -> None:
        """Post people who all cross the picture from left to right, 14 m ahead of the camera."""
        rng = self._next_rng()
        ahead = np.array([math.sin(pose.heading_rad), math.cos(pose.heading_rad)])
        right = np.array([math.cos(pose.heading_rad), -math.sin(pose.heading_rad)])
        along_m = 0.4 * np.arange(20)
        for _ in range(count):
            start = 14 * ahead - 5 * right + rng.normal(0, 0.4, 2)
            ground = start + np.outer(along_m * rng.normal(1.4, 0.2), right)
            uv, _ = pixel_from_ground(LENS, pose.rotation, pose.centre_m, ground)
            uv += rng.normal(0, 1.0, uv.shape)
            inside = LENS.contains(uv)
            self._see(0.4 * np.arange(-19, 1)[inside], uv[inside])
        self._post()

    def keep_to_lanes(self, pose: CameraPose, count: int, *, lens: Intrinsics = LENS) -> None:
        """Post people of whom each walks one of three lanes, the same ones every time."""
        if not self._lanes:
            self._lanes = draw_lanes(LENS, PRIOR, LANES, np.random.default_rng(3))
        for seen in walk_site(lens, pose, self._lanes, LANES, count, self._next_rng()):
            self._see(seen.time_s - seen.time_s[-1], seen.uv)
        self._post()

    def _next_rng(self) -> np.random.Generator:
        self.seed += 1
        return np.random.default_rng(self.seed)

    def _see(self, time_s: np.ndarray, uv: np.ndarray, boxes: np.ndarray | None = None) -> None:
        """Take down one more person, whose walk ends 5 s after the last one's."""
        self.clock_s += 5.0
        time_s = self.clock_s + time_s
        form, rows, top_v = "points", uv, None
        if boxes is not None:
            form, rows, top_v = "boxes", boxes, tops_of_boxes(LENS, boxes)
            uv = np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])
        body = {"id": str(len(self.seen)), form: np.column_stack([time_s, rows]).tolist()}
        self._bodies.append(body)
        self.seen.append(Trajectory(time_s=time_s, uv=uv, top_v=top_v))

    def _post(self) -> None:
        body = {"tracks": self._bodies}
        if self.source is not None:
            body["source"] = self.source
        answer = self.http.post(f"/cameras/{self.camera_id}/tracks", json=body)
        assert answer.json()["accepted"] == len(self._bodies), answer.text
        self._bodies.clear()

    def look(self, *, full: bool = False) -> dict[str, Any]:
        """Run the estimate job, a `full` one if wanted; return the served pose."""
        if full:
            with self.context.store.write() as session:
                session.get_one(CameraRecord, self.camera_id).full_estimate_asked = True
        run_estimate(self.context, self.camera_id)
        return self.pose()

    def pose(self) -> dict[str, Any]:
        body: dict[str, Any] = self.http.get(f"/cameras/{self.camera_id}/pose").json()
        return body

    def alerts(self, **query: str) -> list[dict[str, Any]]:
        items: list[dict[str, Any]] = self.http.get("/alerts", params=query).json()["items"]
        return items

    def observed(self, first: int, last: int) -> Any:
        """What the joint estimator reads of the posted tracks."""
        return observe(self.seen[first:last], LENS, PRIOR)


def people_boxes(pose: CameraPose, uv: np.ndarray, tall_m: float) -> np.ndarray:
    """Boxes (N, 4) of a person with feet (N, 2); those whose head is out of sight reach y = 0."""
    ground, _ = ground_from_pixel(LENS, pose.rotation, pose.centre_m, uv)
    top = tops_seen(LENS, pose.rotation, pose.centre_m, ground, np.full(len(uv), tall_m))
    top = np.where(np.isfinite(top), top, 0.0)
    half = 0.2 * (uv[:, 1] - top)
    return np.column_stack([uv[:, 0] - half, top, uv[:, 0] + half, uv[:, 1]])


def tall(pose: CameraPose, trajectory: Trajectory) -> np.ndarray:
    """How tall the boxes of a track say that its person is, where they say it."""
    assert trajectory.top_v is not None
    found, valid = statures(LENS, pose.rotation, pose.height_m, trajectory.uv, trajectory.top_v)
    return found[valid]
