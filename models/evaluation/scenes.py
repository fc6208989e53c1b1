"""Recorded scenes: a camera with its true pose and the tracks of real people."""

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.errors import CalibrationError, ShapeError
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneTrack:
    """One recorded person: the tracker's name for them and their foot points."""

    track_id: str
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A recorded camera: its lens, its true pose and the tracks seen by it."""

    scene_id: str
    intrinsics: Intrinsics
    true_pose: CameraPose
    frame_rate_hz: float
    tracks: tuple[SceneTrack, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knock:
    """A move of the camera: radians of tilt and roll, and the logarithm of the height ratio."""

    tilt_rad: float = 0.0
    roll_rad: float = 0.0
    log_height: float = 0.0

    def apply(self, pose: CameraPose) -> CameraPose:
        """The pose after the move."""
        return replace(
            pose,
            height_m=pose.height_m * math.exp(self.log_height),
            tilt_rad=pose.tilt_rad + self.tilt_rad,
            roll_rad=pose.roll_rad + self.roll_rad,
        )


def load_scene(folder: Path) -> Scene:
    """The scene of a folder with `camera.json` and `tracks.csv`; tracks by their first time.

    Raises:
        ShapeError: a file is missing or lacks a field.
    """
    try:
        camera = json.loads((folder / "camera.json").read_text())
        with (folder / "tracks.csv").open(newline="") as lines:
            rows = [
                (row["track_id"], float(row["time_s"]), float(row["u_px"]), float(row["v_px"]))
                for row in csv.DictReader(lines)
            ]
        lens, pose = camera["intrinsics"], camera["true_pose"]
        return Scene(
            scene_id=camera["id"],
            intrinsics=Intrinsics(**{**lens, "distortion": tuple(lens["distortion"])}),
            true_pose=CameraPose(
                height_m=pose["height_m"],
                tilt_rad=math.radians(pose["tilt_deg"]),
                roll_rad=math.radians(pose["roll_deg"]),
                heading_rad=math.radians(pose["heading_deg"]),
                x_m=pose["x_m"],
                y_m=pose["y_m"],
            ),
            frame_rate_hz=camera["frame_rate_hz"],
            tracks=_tracks(rows),
        )
    except CalibrationError:
        raise
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ShapeError(f"scene {folder}: camera.json or tracks.csv: {error!r}") from error


def knock_trajectory(
    trajectory: Trajectory, intrinsics: Intrinsics, pose: CameraPose, knocked: CameraPose
) -> Trajectory | None:
    """What the camera sees of the same feet after a move; the longest run inside the image.

    None where fewer than two points stay in the picture.

    Source: virtual knock; exact, since foot points lie on the ground.
    """
    ground, on_ground = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, trajectory.uv)
    uv, _ = pixel_from_ground(intrinsics, knocked.rotation, knocked.centre_m, ground)
    seen = on_ground & intrinsics.contains(uv)
    runs = np.split(np.arange(seen.size), np.flatnonzero(np.diff(seen)) + 1)
    longest = max((run for run in runs if seen[run[0]]), key=len, default=np.arange(0))
    if longest.size < 2:
        return None
    return Trajectory(time_s=trajectory.time_s[longest], uv=uv[longest])


def _tracks(rows: Sequence[tuple[str, float, float, float]]) -> tuple[SceneTrack, ...]:
    by_id: dict[str, list[tuple[float, float, float]]] = {}
    for track_id, *point in rows:
        by_id.setdefault(track_id, []).append((point[0], point[1], point[2]))
    tracks = []
    for track_id, points in by_id.items():
        array = np.array(sorted(points))
        trajectory = Trajectory(time_s=array[:, 0], uv=array[:, 1:])
        tracks.append(SceneTrack(track_id=track_id, trajectory=trajectory))
    return tuple(sorted(tracks, key=lambda track: track.trajectory.time_s[0]))
