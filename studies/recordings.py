"""Recordings of hours and days: people followed on the ground, or by real cameras for a week."""

import csv
import gzip
import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from models.errors import CalibrationError, ShapeError
from models.geometry.intrinsics import Intrinsics
from models.tracks.scenes import Scene, SceneTrack, load_scene, pose_of_json
from models.tracks.trajectory import Trajectory
from studies.virtual_cameras import draw_cameras, seen_by

_ON_GROUND = ("tracks_ground_aligned.csv.gz", "tracks_ground.csv.gz")  # the first that is there
_VIRTUAL = 3  # cameras before people who were followed on the ground


def load_recording(folder: Path) -> list[Scene]:
    """The cameras of a folder: of a scene one, of a long recording several, by their names.

    A folder holds a scene, as `load_scene` reads it; or `camera.json` and the people of
    `tracks_ground.csv.gz` (`track_id,time_s,x_m,y_m`), or of `tracks_ground_aligned.csv.gz` if it
    is there, before which its camera and two drawn ones are put; or `poses.json` with the poses of
    real cameras, and of each camera `NAME.csv.gz`
    (`track_id,clip,camera_model,time_s,u_px,v_px,box_h_px`), of which the pose with most points
    counts.

    Raises:
        ShapeError: a file is missing or lacks a field.
    """
    if (folder / "tracks.csv").exists():
        return [load_scene(folder)]
    try:
        if (folder / "poses.json").exists():
            cameras = json.loads((folder / "poses.json").read_text())
            return [
                _real_camera(folder / f"{name}.csv.gz", name, models)
                for name, models in sorted(cameras.items())
            ]
        return _virtual_cameras(folder)
    except CalibrationError:
        raise
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ShapeError(f"recording {folder}: {error!r}") from error


def _virtual_cameras(folder: Path) -> list[Scene]:
    camera = json.loads((folder / "camera.json").read_text())
    lens, pose = _lens(camera["intrinsics"]), pose_of_json(camera["true_pose"])
    aligned, raw = (folder / name for name in _ON_GROUND)
    path = aligned if aligned.exists() else raw
    rows = _numbers(path)
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    reach_m = float(camera["max_ground_distance_m"])
    poses = [pose, *draw_cameras(lens, pose, rows[:, 2:4], reach_m, _VIRTUAL - 1)]
    stem = camera["id"].removesuffix("-a")
    return [
        Scene(
            scene_id=f"{stem}-{letter}",
            intrinsics=lens,
            true_pose=one,
            frame_rate_hz=float(camera["frame_rate_hz"]),
            tracks=seen_by(lens, one, rows, reach_m),
            beyond_picture=True,
        )
        for letter, one in zip("abcdefgh", poses, strict=False)
    ]


def _real_camera(path: Path, name: str, cameras: Mapping[str, Any]) -> Scene:
    with gzip.open(path, "rt", newline="") as lines:
        rows = list(csv.DictReader(lines))
    usual, _ = Counter(row["camera_model"] for row in rows).most_common(1)[0]
    kept = [row for row in rows if row["camera_model"] == usual]
    points = np.array(
        [[float(row[key]) for key in ("time_s", "u_px", "v_px", "box_h_px")] for row in kept]
    )
    names = np.array([row["track_id"] for row in kept])
    tracks = []
    for track_id in dict.fromkeys(names.tolist()):
        own = points[names == track_id]
        own = own[np.argsort(own[:, 0], kind="stable")]
        own = own[np.append(True, np.diff(own[:, 0]) > 0)]
        top_v = own[:, 2] - own[:, 3]
        trajectory = Trajectory(
            time_s=own[:, 0], uv=own[:, 1:3], top_v=np.where(top_v > 1, top_v, np.nan)
        )
        tracks.append(SceneTrack(track_id=track_id, trajectory=trajectory, person_id=track_id))
    return Scene(
        scene_id=f"{path.parent.name}-{name}",
        intrinsics=_lens(cameras[usual]["intrinsics"]),
        true_pose=pose_of_json(cameras[usual]["true_pose"]),
        frame_rate_hz=10.0,
        tracks=tuple(sorted(tracks, key=lambda track: float(track.trajectory.time_s[0]))),
    )


def _numbers(path: Path) -> npt.NDArray[np.float64]:
    """The rows of a table of numbers, without its heading."""
    heading, _, body = gzip.decompress(path.read_bytes()).decode().partition("\n")
    columns = heading.strip().split(",")
    if columns != ["track_id", "time_s", "x_m", "y_m"]:
        raise ShapeError(f"{path}: track_id,time_s,x_m,y_m are needed, got {heading.strip()}")
    return np.array(body.replace("\n", ",").rstrip(",").split(","), dtype=np.float64).reshape(-1, 4)


def _lens(values: Mapping[str, Any]) -> Intrinsics:
    return Intrinsics(**{**values, "distortion": tuple(values["distortion"])})
