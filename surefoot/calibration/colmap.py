"""COLMAP's text model: `cameras.txt` and `images.txt`.

Source: COLMAP, "Output Format" and "Camera Models".
"""

from collections.abc import Mapping
from typing import NamedTuple, TypeVar

from models.geometry.intrinsics import Projection
from models.geometry.rotation import rotation_from_quaternion
from surefoot.calibration.lens import distortion_of
from surefoot.calibration.value import Calibration, CalibrationFileError, Note

T = TypeVar("T")
_PIXEL_CENTRE = 0.5  # of COLMAP's first pixel; ours is 0


class _Model(NamedTuple):
    """How many focal lengths a model has, and places of its other numbers in our order."""

    focals: int
    projection: Projection
    coefficients: int


_P, _F = Projection.PERSPECTIVE, Projection.FISHEYE
_MODELS = {
    "SIMPLE_PINHOLE": _Model(1, _P, 0),
    "PINHOLE": _Model(2, _P, 0),
    "SIMPLE_RADIAL": _Model(1, _P, 1),
    "RADIAL": _Model(1, _P, 2),
    "OPENCV": _Model(2, _P, 4),
    "FULL_OPENCV": _Model(2, _P, 8),
    "SIMPLE_RADIAL_FISHEYE": _Model(1, _F, 1),
    "RADIAL_FISHEYE": _Model(1, _F, 2),
    "OPENCV_FISHEYE": _Model(2, _F, 4),
}


def read_colmap(files: Mapping[str, str], camera: str | None) -> Calibration:
    """The lens and pose of an image of the model; of the lens alone without `images.txt`.

    Args:
        files: `cameras.txt`, and perhaps `images.txt`, by their names.
        camera: the name of the image, with or without its ending, where there are several.

    Raises:
        CalibrationFileError: a line is damaged, or it has to be chosen among several.
    """
    cameras = [line.split() for line in _lines(files.get("cameras.txt", ""))]
    if "images.txt" not in files:
        chosen = chosen_of({row[0]: row for row in cameras}, camera)
        return _lens(chosen)
    images = {row[9]: row for row in _images(files["images.txt"])}
    row = chosen_of(images, camera)
    lens = next((each for each in cameras if each[0] == row[8]), None)
    if lens is None:
        raise CalibrationFileError(f"cameras.txt: has no camera {row[8]} (of image {row[9]})")
    turn, moved = _floats("images.txt", row[1:5]), _floats("images.txt", row[5:8])
    found = _lens(lens)
    return Calibration(
        format=found.format,
        camera=row[9],
        size=found.size,
        matrix=found.matrix,
        projection=found.projection,
        distortion=found.distortion,
        rotation=tuple(rotation_from_quaternion(turn).ravel().tolist()),
        translation_m=tuple(moved),
        notes={**found.notes, Note.OWN_WORLD: {}},
    )


def chosen_of(found: Mapping[str, T], wanted: str | None) -> T:
    """The only one, or the one of the name, with or without a file's ending.

    Raises:
        CalibrationFileError: it has to be chosen, or there is none of that name.
    """
    stems = {name.rpartition("/")[2].rpartition(".")[0] or name: name for name in found}
    name = stems.get(wanted or "", wanted or "")
    if name in found:
        return found[name]
    if len(found) == 1:
        return next(iter(found.values()))
    if not found:
        raise CalibrationFileError("file: has no camera")
    names = ", ".join(list(found)[:8]) + (", ..." if len(found) > 8 else "")
    raise CalibrationFileError(
        f"camera: must be one of the {len(found)} in the file: {names} (got {wanted or 'none'})"
    )


def _lens(row: list[str]) -> Calibration:
    _, name, *rest = row if len(row) > 4 else ["", "", ""]
    model = _MODELS.get(name)
    if model is None:
        raise CalibrationFileError(
            f"cameras.txt: the model must be one of {', '.join(_MODELS)} (got {name!r:.40})"
        )
    numbers = _floats("cameras.txt", rest)
    wanted = 2 + model.focals + 2 + model.coefficients
    if len(numbers) != wanted:
        raise CalibrationFileError(
            f"cameras.txt: {name} must have {wanted} numbers (got {len(numbers)})"
        )
    width, height, *numbers = numbers
    fx, fy = numbers[0], numbers[model.focals - 1]
    cx, cy, *coefficients = numbers[model.focals :]
    matrix = (fx, 0.0, cx - _PIXEL_CENTRE, 0.0, fy, cy - _PIXEL_CENTRE, 0.0, 0.0, 1.0)
    size = round(width), round(height)
    if model.projection is _F:
        coefficients = [*coefficients, 0.0, 0.0, 0.0, 0.0][:4]
    lens = distortion_of(coefficients or [0.0], model.projection, matrix, size)
    return Calibration(
        format="COLMAP", camera=row[0], size=size, matrix=matrix,
        projection=lens.projection, distortion=lens.values, notes=lens.notes,
    )  # fmt: skip


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _images(text: str) -> list[list[str]]:
    """The rows of images; after each is a line of its points, which may be empty."""
    rows, points = [], False
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        if points:
            points = False
        elif line.strip():
            row = line.split(maxsplit=9)
            if len(row) != 10:
                raise CalibrationFileError(
                    f"images.txt: an image must have 10 fields (got {len(row)}: {line:.40})"
                )
            rows.append([*row[:9], row[9].strip()])
            points = True
    return rows


def _floats(name: str, texts: list[str]) -> list[float]:
    try:
        return [float(text) for text in texts]
    except ValueError as error:
        raise CalibrationFileError(f"{name}: must have numbers ({error})") from error
