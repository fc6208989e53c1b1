"""Reads one OpenCV file from stdin and writes what it says to stdout, as JSON.

A process of its own, see `confined`: `python -m service.formats.calibration_reader CPU_S`.
"""

import json
import math
import re
import sys
from typing import Any

import cv2
import numpy as np

from models.geometry.intrinsics import Projection, coefficients_of
from service.formats.confined import give_up_rights

MAX_INPUT_BYTES = 2 * 1024 * 1024
# What tutorials, calib3d's samples and ROS call things.
_NAMES = {
    "matrix": ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1", "intrinsics", "M"),
    "distortion": (
        "distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs",
        "dist_coeff", "distortion", "D", "D1",
    ),
    "fisheye": ("fisheye_model",),
    "model": ("distortion_model",),
    "rotation": ("R", "rotation", "rotation_matrix", "rotationMatrix", "rvec", "rvecs"),
    "translation": ("t", "T", "translation", "translation_vector", "tvec", "tvecs"),
    "width": ("image_width", "image_Width", "width"),
    "height": ("image_height", "image_Height", "height"),
}  # fmt: skip

_DOCUMENT = re.compile(r"^---[ \t]*$", re.MULTILINE)
_PERSPECTIVES, _FISHEYES = ("plumb_bob", "radtan", "none"), ("equidistant", "fisheye")


class _RefusedError(Exception):
    """The file is not what is looked for; the message says why."""


def main() -> None:
    """Answer for the file on stdin: its numbers, or `{"refused": why}`."""
    body = sys.stdin.buffer.read(MAX_INPUT_BYTES)
    give_up_rights(int(sys.argv[1]))
    try:
        answer: dict[str, Any] = _read_file(body)
    except _RefusedError as error:
        answer = {"refused": str(error)}
    sys.stdout.write(json.dumps(answer))


def _read_file(body: bytes) -> dict[str, Any]:
    text = _first_document(body.decode("utf-8", errors="replace")).strip()
    flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
    try:
        storage = cv2.FileStorage(text + "\n", flags)
        if not storage.isOpened():
            raise _RefusedError("this is no OpenCV YAML, XML or JSON")
        return _read(storage)
    except (cv2.error, SystemError, MemoryError) as error:
        raise _RefusedError("this is no OpenCV YAML, XML or JSON") from error


def _first_document(text: str) -> str:
    """The first document of YAML, which is all that OpenCV reads; ROS' has a pose after it."""
    head, *documents = _DOCUMENT.split(text)
    if documents and (not head.strip() or head.lstrip().startswith("%")):
        return f"{head}---{documents[0]}"
    return head


def _read(storage: cv2.FileStorage) -> dict[str, Any]:
    matrix = _numbers(storage, "matrix", (9,))
    projection = _projection(storage)
    counts = {Projection.PERSPECTIVE: (1, 2, 3, 4, 5, 8, 12, 14), Projection.FISHEYE: (4,)}
    distortion = _numbers(storage, "distortion", counts[projection])
    rotation = _numbers(storage, "rotation", (3, 9))
    translation = _numbers(storage, "translation", (3,))
    if matrix is None and rotation is None:
        raise _RefusedError(
            "neither a camera matrix (camera_matrix, K) nor a rotation (R, rvec) is in this file"
        )
    if distortion is not None and any(distortion[5:]):
        raise _RefusedError(
            f"the lens has {len(distortion)} distortion numbers; k1, k2, p1, p2, k3 are taken. "
            "Calibrate again without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL, CALIB_TILTED"
        )
    sides = [_number(storage, name) for name in ("width", "height")]
    return {
        "matrix": matrix,
        "projection": projection,
        "distortion": None
        if distortion is None
        else [*distortion, 0, 0, 0, 0][: len(coefficients_of(projection))],
        "rotation": rotation,
        "translation": translation,
        "size": None if None in sides else [int(side or 0) for side in sides],
    }


def _projection(storage: cv2.FileStorage) -> Projection:
    """The lens' projection, as OpenCV's calibration sample, ROS and Kalibr say it."""
    model = storage.getNode(_NAMES["model"][0])
    said = model.string() if model.isString() else "plumb_bob"
    if _number(storage, "fisheye") or said in _FISHEYES:
        return Projection.FISHEYE
    if said not in _PERSPECTIVES:
        raise _RefusedError(
            f"distortion_model: {' or '.join((*_PERSPECTIVES, *_FISHEYES))} is taken, got "
            f"{said!r:.40}"
        )
    return Projection.PERSPECTIVE


def _numbers(storage: cv2.FileStorage, what: str, counts: tuple[int, ...]) -> list[float] | None:
    for name in _NAMES[what]:
        node = storage.getNode(name)
        if node.empty():
            continue
        values = _values(node)
        if len(values) not in counts or not all(math.isfinite(value) for value in values):
            wanted = " or ".join(str(count) for count in counts)
            raise _RefusedError(f"{name}: {wanted} finite numbers are needed, got {len(values)}")
        return values
    return None


def _values(node: Any) -> list[float]:
    """The numbers of a matrix, or of a plain list."""
    if node.isSeq():
        items = [node.at(n) for n in range(node.size())]
        return [item.real() for item in items if item.isReal() or item.isInt()]
    if node.isMap() and "dt" not in node.keys():  # noqa: SIM118, a node is no dict; ROS' matrix
        return _values(node.getNode("data"))
    matrix = node.mat() if node.isMap() else None
    return [] if matrix is None else np.asarray(matrix, dtype=np.float64).ravel().tolist()


def _number(storage: cv2.FileStorage, what: str) -> float | None:
    for name in _NAMES[what]:
        node = storage.getNode(name)
        if (node.isInt() or node.isReal()) and math.isfinite(node.real()):
            return float(node.real())
    return None


if __name__ == "__main__":
    main()
