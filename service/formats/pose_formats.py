"""A served pose in the formats that other tools read, by name."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.formats.colmap_zip import colmap_zip
from service.formats.geojson import GeoOrigin, geojson
from service.formats.nvidia_json import nvidia_json
from service.formats.opencv_yaml import opencv_yaml
from service.formats.ros_yaml import ros_yaml


class PoseFormat(StrEnum):
    """The formats of a pose beside our own JSON."""

    OPENCV = "opencv"
    ROS = "ros"
    GEOJSON = "geojson"
    COLMAP = "colmap"
    NVIDIA = "nvidia"


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseFile:
    """A pose as a file."""

    name: str
    media_type: str
    content: str | bytes


MEDIA_TYPES = {
    PoseFormat.OPENCV: "application/yaml",
    PoseFormat.ROS: "application/yaml",
    PoseFormat.GEOJSON: "application/geo+json",
    PoseFormat.COLMAP: "application/zip",
    PoseFormat.NVIDIA: "application/vnd.surefoot.calibration+json",
}
_ENDINGS = {
    PoseFormat.OPENCV: "yaml",
    PoseFormat.ROS: "ros.yaml",
    PoseFormat.GEOJSON: "geojson",
    PoseFormat.COLMAP: "colmap.zip",
    PoseFormat.NVIDIA: "nvidia.json",
}


def pose_file(
    kind: PoseFormat,
    intrinsics: Intrinsics,
    pose: CameraPose,
    *,
    camera_id: str,
    at: datetime | None,
    words: Sequence[str],
    origin: GeoOrigin | None = None,
) -> PoseFile:
    """The pose of a camera in a format.

    `at` is the time that the pose is of, None of a prior pose; `words` are comments, where the
    format has such.

    Raises:
        MalformedError: the camera is too far from the origin.
    """
    match kind:
        case PoseFormat.OPENCV:
            content: str | bytes = opencv_yaml(intrinsics, pose, camera_id=camera_id, words=words)
        case PoseFormat.ROS:
            content = ros_yaml(intrinsics, pose, camera_id=camera_id, at=at, words=words)
        case PoseFormat.GEOJSON:
            content = geojson(intrinsics, pose, camera_id=camera_id, origin=origin)
        case PoseFormat.COLMAP:
            content = colmap_zip(intrinsics, pose, camera_id=camera_id)
        case PoseFormat.NVIDIA:
            content = nvidia_json(intrinsics, pose, camera_id=camera_id)
    return PoseFile(
        name=f"{camera_id}.{_ENDINGS[kind]}", media_type=MEDIA_TYPES[kind], content=content
    )
