"""Recorded scenes: a camera with its true pose and the tracks of real people."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.errors import CalibrationError, ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.upright import tops_of_boxes
from models.tracks.trajectory import Trajectory

_POSE_FIELDS = ("height_m", "tilt_deg", "roll_deg", "heading_deg", "x_m", "y_m")
# How WILDTRACK's notes say that a track's number is a person's and a running one.
_PERSON_IN_HUNDREDS = "track_id//100 = personID"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneTrack:
    """One recorded track: the tracker's name for it, and who it is, where the scene knows.

    Several tracks may be of one person, who left the picture and came back.
    """

    track_id: str
    trajectory: Trajectory
    person_id: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A recorded camera: its lens, its true pose and the tracks seen by it.

    `beyond_picture` says that people were followed on the ground, where the picture ends too.
    """

    scene_id: str
    intrinsics: Intrinsics
    true_pose: CameraPose
    frame_rate_hz: float
    tracks: tuple[SceneTrack, ...]
    beyond_picture: bool = False


def load_scene(folder: Path) -> Scene:
    """The scene of a folder with `camera.json` and `tracks.csv`; tracks by their first time.

    Boxes are read from `boxes.csv` where there is one.

    Raises:
        ShapeError: a file is missing or lacks a field.
    """
    try:
        camera = json.loads((folder / "camera.json").read_text())
        lens, pose = camera["intrinsics"], camera["true_pose"]
        intrinsics = Intrinsics(**lens)
        tops = _tops(folder / "boxes.csv", intrinsics)
        with (folder / "tracks.csv").open(newline="") as lines:
            rows = [
                (
                    row["track_id"],
                    float(row["time_s"]),
                    float(row["u_px"]),
                    float(row["v_px"]),
                    tops.get((row["track_id"], row["frame"]), np.nan),
                )
                for row in csv.DictReader(lines)
            ]
        persons = _PERSON_IN_HUNDREDS in camera.get("notes", "")
        return Scene(
            scene_id=camera["id"],
            intrinsics=intrinsics,
            true_pose=pose_of_json(pose),
            frame_rate_hz=camera["frame_rate_hz"],
            tracks=_tracks(rows, has_boxes=bool(tops), person_in_hundreds=persons),
        )
    except CalibrationError:
        raise
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ShapeError(f"scene {folder}: camera.json or tracks.csv: {error!r}") from error


def pose_of_json(values: Mapping[str, float]) -> CameraPose:
    """The pose of a recording's `true_pose`, which has all six numbers.

    Raises:
        KeyError: one is missing.
    """
    return CameraPose.of_degrees(**{name: values[name] for name in _POSE_FIELDS})


def _tops(path: Path, intrinsics: Intrinsics) -> dict[tuple[str, str], float]:
    """The upper edge of each box by track and frame; empty where the scene has no boxes."""
    if not path.exists():
        return {}
    with path.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    boxes = np.array([[float(row[side]) for side in ("x1", "y1", "x2", "y2")] for row in rows])
    tops = tops_of_boxes(intrinsics, boxes.reshape(-1, 4))
    return {(row["track_id"], row["frame"]): top for row, top in zip(rows, tops, strict=True)}


def _tracks(
    rows: Sequence[tuple[str, float, float, float, float]],
    *,
    has_boxes: bool,
    person_in_hundreds: bool,
) -> tuple[SceneTrack, ...]:
    by_id: dict[str, list[tuple[float, float, float, float]]] = {}
    for track_id, *point in rows:
        by_id.setdefault(track_id, []).append((point[0], point[1], point[2], point[3]))
    tracks = []
    for track_id, points in by_id.items():
        array = np.array(sorted(points))
        trajectory = Trajectory(
            time_s=array[:, 0], uv=array[:, 1:3], top_v=array[:, 3] if has_boxes else None
        )
        person = str(int(track_id) // 100) if person_in_hundreds else track_id
        tracks.append(SceneTrack(track_id=track_id, trajectory=trajectory, person_id=person))
    return tuple(sorted(tracks, key=lambda track: track.trajectory.time_s[0]))
