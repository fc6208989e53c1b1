"""A street of simulated people, posted over HTTP and looked at by the real job, by hand."""

import math
import time
from typing import Any

import numpy as np

from models.estimation.joint.observations import observe
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import statures, tops_of_boxes, tops_seen
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.trajectory import Trajectory
from service.job_queue import JobQueue
from service.jobs.context import JobContext
from service.jobs.estimate import run_estimate
from service.store.database import Store

LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(
    height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1), heading_rad=math.radians(40)
)
KNOCKED = CameraPose(
    height_m=6.3, tilt_rad=math.radians(27), roll_rad=math.radians(-3), heading_rad=math.radians(40)
)


class Street:
    """People who walk past a camera one after the other, and the camera's service."""

    def __init__(self, http: Any, settings: Any) -> None:
        self.http = http
        store = Store(settings)
        self.context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))
        self.clock_s = math.floor(time.time()) - 20_000.0
        self.seed = 0
        self.posted: list[Trajectory] = []

    def walk(
        self,
        pose: CameraPose,
        count: int,
        *,
        rate: float = 1.0,
        form: str = "points",
        walk: WalkConfig | None = None,
    ) -> None:
        """Post people seen from a pose; at another rate, their times are that much too short."""
        self.seed += 1
        rng = np.random.default_rng(self.seed)
        config = walk or WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
        walks = simulate_walks(LENS, repeated_pose(pose, count), config, rng)
        tracks = []
        for number, (padded, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
            self.clock_s += 5.0
            time_s = self.clock_s + (np.arange(length) - length + 1) * 0.4 / rate
            uv = padded[:length] + rng.normal(0, 1.0, (length, 2))
            rows = np.column_stack([time_s, uv])
            top_v = None
            if form == "boxes":
                boxes = people_boxes(pose, uv, rng.normal(1.7, 0.07))
                uv = np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])
                top_v = tops_of_boxes(LENS, boxes)
                rows = np.column_stack([time_s, boxes])
            tracks.append({"id": f"{self.seed}-{number}", form: rows.tolist()})
            self.posted.append(Trajectory(time_s=time_s, uv=uv, top_v=top_v))
        answer = self.http.post("/cameras/corner/tracks", json={"tracks": tracks})
        assert answer.json()["accepted"] == len(tracks), answer.text

    def look(self) -> dict[str, Any]:
        """Run the estimate job; returns the served pose."""
        run_estimate(self.context, "corner")
        return self.pose()

    def pose(self) -> dict[str, Any]:
        body: dict[str, Any] = self.http.get("/cameras/corner/pose").json()
        return body

    def alerts(self, **query: str) -> list[dict[str, Any]]:
        items: list[dict[str, Any]] = self.http.get("/alerts", params=query).json()["items"]
        return items

    def observed(self, first: int, last: int) -> Any:
        """What the joint estimator reads of the posted tracks."""
        return observe(self.posted[first:last], LENS)


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
