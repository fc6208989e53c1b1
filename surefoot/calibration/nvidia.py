"""`calibration.json` of NVIDIA's Metropolis: one camera of its `sensors`.

Source: NVIDIA VSS, "Calibration Schema".
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from models.geometry.ground_homography import pose_from_homography
from models.geometry.intrinsics import Intrinsics
from surefoot.calibration.fields import field_numbers, numbers
from surefoot.calibration.lens import camera_matrix
from surefoot.calibration.value import Calibration, CalibrationFileError

_FORMAT = "NVIDIA calibration.json"
_SAME = 1e-3  # of the largest number, by which matrices of one sensor may differ


def sensors_of(document: Mapping[str, Any]) -> dict[str, Mapping[str, Any]] | None:
    """The cameras by their ids; None if the document is none of NVIDIA's.

    Raises:
        CalibrationFileError: a sensor is no object, or has no id.
    """
    sensors = document.get("sensors")
    if not isinstance(sensors, list):
        return None
    found = {}
    for number, sensor in enumerate(sensors):
        if not isinstance(sensor, Mapping) or not isinstance(sensor.get("id"), str):
            raise CalibrationFileError(f"sensors[{number}]: must be an object with an id")
        if sensor.get("type", "camera") == "camera":
            found[sensor["id"]] = sensor
    return found


def read_nvidia(sensor: Mapping[str, Any], kind: object) -> Calibration:
    """The lens and the pose of a sensor, by `extrinsicMatrix` or by `homography`.

    Raises:
        CalibrationFileError: a matrix is missing or contradicts another, or places are no metres.
    """
    if kind not in (None, "cartesian"):
        raise CalibrationFileError(f"calibrationType: must be cartesian (got {kind!r:.40})")
    matrix = camera_matrix(sensor, ("intrinsicMatrix",))
    if matrix is None:
        raise CalibrationFileError("intrinsicMatrix: is required")
    size = _frame_size(sensor)
    intrinsic = np.reshape(matrix.values, (3, 3))
    extrinsic = field_numbers(sensor, ("extrinsicMatrix",), (12, 16))
    rotation: tuple[float, ...] | None = None
    translation: tuple[float, ...] | None = None
    if extrinsic is not None:
        whole = np.reshape(extrinsic, (-1, 4))[:3]
        projection = field_numbers(sensor, ("cameraMatrix",), (12,))
        if projection is not None:
            _check_same("cameraMatrix", np.reshape(projection, (3, 4)), intrinsic @ whole)
        rotation, translation = tuple(whole[:, :3].ravel().tolist()), tuple(whole[:, 3].tolist())
    elif (homography := field_numbers(sensor, ("homography",), (9,))) is not None:
        width, height = size or (2 * intrinsic[0, 2] + 1, 2 * intrinsic[1, 2] + 1)
        lens = Intrinsics(
            width=round(width), height=round(height), fx=intrinsic[0, 0], fy=intrinsic[1, 1],
            cx=intrinsic[0, 2], cy=intrinsic[1, 2],
        )  # fmt: skip
        pose = pose_from_homography(np.reshape(homography, (3, 3)), lens)
        rotation = tuple(pose.rotation.ravel().tolist())
        translation = tuple(pose.translation_m.tolist())
    return Calibration(
        format=_FORMAT,
        size=size,
        matrix=matrix.values,
        rotation=rotation,
        translation_m=translation,
        notes=matrix.notes,
    )


def _frame_size(sensor: Mapping[str, Any]) -> tuple[int, int] | None:
    """Width and height among the attributes, a list of names and values."""
    attributes = sensor.get("attributes")
    if not isinstance(attributes, list):
        return None
    by_name = {
        each["name"]: numbers(each.get("value"))
        for each in attributes
        if isinstance(each, Mapping) and isinstance(each.get("name"), str)
    }
    width, height = (by_name.get(name) for name in ("frameWidth", "frameHeight"))
    return (round(width[0]), round(height[0])) if width and height else None


def _check_same(name: str, given: Any, expected: Any) -> None:
    """Both are known up to a factor."""
    scale = float((given * expected).sum() / (expected * expected).sum())
    off = float(np.abs(given - scale * expected).max() / np.abs(given).max())
    if off > _SAME:
        raise CalibrationFileError(
            f"{name}: must be intrinsicMatrix times extrinsicMatrix within {_SAME:.1%} (got "
            f"{off:.1%})"
        )
