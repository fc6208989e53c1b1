"""The street of the demo: its camera, the knock, its people, and what the terminal shows of it."""

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseOffset, repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.tracks.scenes import SceneTrack
from models.tracks.trajectory import Trajectory
from service.commands.replay import camera_body
from service.degrees import in_degrees
from service.enums import ReferenceState

CAMERA_ID = "demo-street"
LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1))
KNOCK = PoseOffset(tilt_rad=math.radians(6), roll_rad=math.radians(-5))
REFERENCE_TRACKS, STILL_TRACKS, KNOCKED_TRACKS = 100, 50, 100
BETWEEN_S = 6.0  # of the street's time; the recording ends now


def street_people(pose: CameraPose, count: int, seed: int) -> list[SceneTrack]:
    """People seen by a camera, whose walks end one after the other from time 0 on."""
    rng = np.random.default_rng(seed)
    walk = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
    walks = simulate_walks(LENS, repeated_pose(pose, count), walk, rng)
    tracks = []
    for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        time_s = BETWEEN_S * (number + 1) + (np.arange(length) - length + 1) * walk.step_s
        noisy = uv[:length] + rng.normal(0, 1.5, (length, 2))
        tracks.append(
            SceneTrack(track_id=f"{seed}-{number}", trajectory=Trajectory(time_s=time_s, uv=noisy))
        )
    return tracks


def street_body() -> dict[str, Any]:
    """The body that registers the camera."""
    body = camera_body(CAMERA_ID, LENS, PRIOR)
    return {**body, "name": "Demo street", "reference_tracks": REFERENCE_TRACKS}


@dataclass(slots=True)
class Screen:
    """The terminal below the progress bars."""

    tracks: int = 0
    knocked_at: datetime | None = None
    pose: dict[str, Any] | None = None
    alert: dict[str, Any] | None = None

    def table(self, progress: Progress) -> Table:
        """The page as it is now."""
        page = Table.grid()
        page.add_row(progress)
        rows = Table(title=f"{CAMERA_ID}: {self.tracks} people seen", title_justify="left")
        for column in ("", "height m", "tilt deg", "roll deg"):
            rows.add_column(column, justify="left" if not column else "right")
        rows.add_row("prior pose", *_cells(in_degrees(asdict(PRIOR))))
        truth = in_degrees(asdict(KNOCK.apply(PRIOR) if self.knocked_at else PRIOR))
        rows.add_row("true pose" + (" (knocked)" if self.knocked_at else ""), *_cells(truth))
        if self.pose is not None:
            rows.add_row(
                f"served pose: {self.pose['state']}",
                *_cells(self.pose["pose"], self.pose["sd"] or {}),
            )
        page.add_row(rows)
        if self.pose is not None:
            page.add_row(self._words(self.pose))
        return page

    def _words(self, pose: dict[str, Any]) -> str:
        reference = pose["reference"]
        if reference["state"] == ReferenceState.LEARNING:
            return f"learning what is usual here: {pose['reason']}"
        usual = f"people walk at {reference['walking_speed_mps']:.2f} m/s here"
        if self.alert is None:
            return f"{usual}\n{pose['reason']}"
        drift = {name: value or 0.0 for name, value in self.alert["drift"].items()}
        return (
            f"{usual}\n[bold red]ALERT[/] {self.alert['severity']}: since "
            f"{clock(self.alert['changed_at'])} the camera is turned by {drift['angle_deg']:.1f} "
            f"deg\n(tilt {drift['tilt_deg']:+.1f}, roll {drift['roll_deg']:+.1f}), height "
            f"{drift['height_m']:+.2f} m"
        )


def save_picture(page: Table, path: Path) -> None:
    """The last screen as SVG."""
    with open(os.devnull, "w") as nowhere:
        recorder = Console(record=True, width=90, file=nowhere)
        recorder.print(page)
        recorder.save_svg(str(path), title="surefoot demo")


def _cells(pose: Mapping[str, Any], sd: Mapping[str, Any] | None = None) -> list[str]:
    """The numbers of a pose, with their deviations where they are estimated."""
    known = sd or {}
    return [
        f"{pose[name]:.2f}" + ("" if known.get(name) is None else f" ± {known[name]:.2f}")
        for name in ("height_m", "tilt_deg", "roll_deg")
    ]


def clock(moment: str | None) -> str:
    """The time of day in an answer's time."""
    return "an unknown time" if moment is None else f"{datetime.fromisoformat(moment):%H:%M:%S}"
