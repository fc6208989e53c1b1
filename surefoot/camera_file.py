"""Cameras out of files."""

import json
from pathlib import Path
from typing import Any

from models.errors import ShapeError
from surefoot.calibration.reader import read_calibration_file
from surefoot.camera import Camera, Pose, camera_of, is_registration


def read_camera(path: str | Path, camera: str | None = None) -> Camera:
    """The camera of a calibration file with a lens and a pose.

    The file is JSON in the form of a registration over HTTP (`intrinsics` or `lens`, and
    `prior_pose` or `true_pose` with height_m, tilt_deg and perhaps roll_deg, heading_deg, x_m,
    y_m), or a file of OpenCV with R and t, ROS with a PoseStamped in `map`, COLMAP (a ZIP),
    NVIDIA's calibration.json, or KRTD.

    Args:
        path: the file.
        camera: the camera's name in a file of several.

    Raises:
        ShapeError: the file is missing or no calibration, or a number is missing or impossible.
    """
    try:
        body = Path(path).read_bytes()
        if (registered := _registration(body)) is not None:
            return camera_of(registered)  # its angles as they are, not by way of a rotation
        found = read_calibration_file(body, camera)
        lens, pose = found.lens, found.pose
    except (OSError, ValueError) as error:
        raise ShapeError(f"{path}: {error}") from error
    if lens is None or pose is None:
        missing = "lens" if lens is None else "pose in the world"
        notes = f" (notes: {', '.join(found.notes)})" if found.notes else ""
        raise ShapeError(f"{path}: {found.format}: has no {missing}{notes}")
    return Camera(intrinsics=lens, prior_pose=Pose.of(pose))


def _registration(body: bytes) -> dict[str, Any] | None:
    try:
        document = json.loads(body)
    except ValueError:
        return None
    return document if is_registration(document) else None
