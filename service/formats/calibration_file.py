"""Calibrations as OpenCV's FileStorage keeps them, in YAML, XML or JSON."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from models.geometry.rotation import Array
from service.errors import FieldError, MalformedError

if TYPE_CHECKING:
    import cv2

MAX_BYTES = 1024 * 1024
# What tutorials, calib3d's samples and ROS call things.
_NAMES = {
    "matrix": ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1", "intrinsics", "M"),
    "distortion": (
        "distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs",
        "dist_coeff", "distortion", "D", "D1",
    ),
    "rotation": ("R", "rotation", "rotation_matrix", "rotationMatrix", "rvec", "rvecs"),
    "translation": ("t", "T", "translation", "translation_vector", "tvec", "tvecs"),
    "width": ("image_width", "image_Width", "width"),
    "height": ("image_height", "image_Height", "height"),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationFile:
    """What a file says; None where it does not. `rotation` has 9 numbers, or 3 of a vector."""

    matrix: tuple[float, ...] | None
    distortion: tuple[float, ...] | None
    rotation: tuple[float, ...] | None
    translation: tuple[float, ...] | None
    size: tuple[int, int] | None


def read_calibration(body: bytes) -> CalibrationFile:
    """The calibration in a file of OpenCV's.

    Raises:
        MalformedError: it is none, says nothing of a camera, or what it says has another shape.
    """
    import cv2  # 40 MB that few registrations need

    text = body.decode("utf-8", errors="replace").strip()
    if len(body) > MAX_BYTES or not text or "\0" in text:
        raise _malformed(f"an OpenCV file of at most {MAX_BYTES // 1024} KiB is needed")
    try:
        storage = cv2.FileStorage(text + "\n", cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        try:
            if not storage.isOpened():
                raise _malformed("this is no OpenCV YAML, XML or JSON")
            return _read(storage)
        finally:
            storage.release()
    except (cv2.error, SystemError) as error:
        raise _malformed("this is no OpenCV YAML, XML or JSON") from error


def _read(storage: "cv2.FileStorage") -> CalibrationFile:
    matrix = _numbers(storage, "matrix", (9,))
    distortion = _numbers(storage, "distortion", (1, 2, 3, 4, 5, 8, 12, 14))
    rotation = _numbers(storage, "rotation", (3, 9))
    translation = _numbers(storage, "translation", (3,))
    if matrix is None and rotation is None:
        raise _malformed(
            "neither a camera matrix (camera_matrix, K) nor a rotation (R, rvec) is in this file"
        )
    if distortion is not None and any(distortion[5:]):
        raise _malformed(
            f"the lens has {len(distortion)} distortion numbers; k1, k2, p1, p2, k3 are taken. "
            "Calibrate again without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL, CALIB_TILTED"
        )
    sides = [_number(storage, name) for name in ("width", "height")]
    return CalibrationFile(
        matrix=matrix,
        distortion=None if distortion is None else (*distortion, 0, 0, 0, 0)[:5],
        rotation=rotation,
        translation=translation,
        size=None if None in sides else (int(sides[0] or 0), int(sides[1] or 0)),
    )


def _numbers(
    storage: "cv2.FileStorage", what: str, counts: tuple[int, ...]
) -> tuple[float, ...] | None:
    for name in _NAMES[what]:
        node = storage.getNode(name)
        if node.empty():
            continue
        values = _values(node)
        if len(values) not in counts or not np.isfinite(values).all():
            wanted = " or ".join(str(count) for count in counts)
            raise _malformed(f"{name}: {wanted} finite numbers are needed, got {len(values)}")
        return tuple(float(value) for value in values)
    return None


def _values(node: Any) -> Array:
    """The numbers of a matrix, or of a plain list."""
    if node.isSeq():
        items = [node.at(n) for n in range(node.size())]
        return np.array([item.real() for item in items if item.isReal() or item.isInt()])
    matrix = node.mat() if node.isMap() else None
    return np.zeros(0) if matrix is None else np.asarray(matrix, dtype=np.float64).ravel()


def _number(storage: "cv2.FileStorage", what: str) -> float | None:
    for name in _NAMES[what]:
        node = storage.getNode(name)
        if node.isInt() or node.isReal():
            return float(node.real())
    return None


def _malformed(reason: str) -> MalformedError:
    return MalformedError(reason, (FieldError(pointer="/file", reason=reason),))
