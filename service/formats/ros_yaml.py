"""A camera as ROS reads it: a file of `camera_info_url`, and its pose as a PoseStamped.

Source: camera_calibration_parsers (the first document), geometry_msgs/PoseStamped (the second).
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np

from models.geometry.intrinsics import Intrinsics, Projection
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.formats.opencv_yaml import yaml_number

# image_geometry's words; each has its numbers in our order.
_MODELS = {Projection.PERSPECTIVE: "plumb_bob", Projection.FISHEYE: "equidistant"}
_WORLD = "map"  # REP 105: metres, z up


def ros_yaml(
    intrinsics: Intrinsics,
    pose: CameraPose,
    *,
    camera_id: str,
    at: datetime | None,
    words: Sequence[str],
) -> str:
    """Two YAML documents: the lens, then the pose of its optical frame (x right, y down) in `map`.

    The lens comes first since ROS' own reader takes the first document alone. A PoseStamped says
    where the frame stands in the world: the centre, and the inverse of `camera_from_world`.

    ROS takes no hyphens in a name, so that those of the id become underscores. `at` is the time
    that the pose is of; 0, ROS' word for unknown, where it is the prior pose. `words` are comments
    for the head of the file; line breaks in them are taken out.
    """
    w, x, y, z = pose.quaternion_wxyz
    since = timedelta() if at is None else at - datetime(1970, 1, 1, tzinfo=UTC)
    sec, nanosec = divmod(since // timedelta(microseconds=1) * 1000, 1_000_000_000)
    lines = [
        *(f"# {' '.join(word.split())}" for word in words),
        f"image_width: {intrinsics.width}",
        f"image_height: {intrinsics.height}",
        f'camera_name: "{camera_id.replace("-", "_")}"',
        *_matrix("camera_matrix", intrinsics.matrix),
        f"distortion_model: {_MODELS[intrinsics.projection]}",
        *_matrix("distortion_coefficients", np.array([intrinsics.distortion])),
        *_matrix("rectification_matrix", np.eye(3)),
        *_matrix("projection_matrix", np.hstack([intrinsics.matrix, np.zeros((3, 1))])),
        "---",
        "header:",
        f"  stamp: {{sec: {sec}, nanosec: {nanosec}}}",
        f"  frame_id: {_WORLD}",
        "pose:",
        f"  position: {_fields('xyz', pose.centre_m)}",
        f"  orientation: {_fields('xyzw', np.array([-x, -y, -z, w]))}",
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = values.shape
    numbers = ", ".join(map(yaml_number, values.ravel()))
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{numbers}]"]


def _fields(names: str, values: Array) -> str:
    said = ", ".join(
        f"{name}: {yaml_number(each)}" for name, each in zip(names, values, strict=True)
    )
    return f"{{{said}}}"
