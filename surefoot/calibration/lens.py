"""Camera matrices and distortions as tools write them, in our order."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from models.errors import ShapeError
from models.geometry.intrinsics import Projection, coefficients_of
from models.geometry.rational import replaced
from surefoot.calibration.fields import field_numbers
from surefoot.calibration.value import CalibrationFileError, Note

_PERSPECTIVES = ("plumb_bob", "radtan", "radial-tangential", "none", "rational_polynomial",
                 "brown_conrady", "opencv", "perspective")  # fmt: skip
FISHEYES = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "opencv_fisheye")
# Models of other tools that a lens of ours does not describe.
OTHERS = ("omni", "omnidirectional", "mei", "ds", "eucm", "fov", "scaramuzza", "ocam",
          "inverse_brown_conrady", "division", "ftheta", "thin_prism_fisheye")  # fmt: skip
_COUNTS = {Projection.PERSPECTIVE: (1, 2, 3, 4, 5, 8, 12, 14), Projection.FISHEYE: (4,)}
_MOST_OFF_PX = 3.0  # at a width of 1920, as marks in an image: a lens in place of another
_SKEW_PX = 0.5  # more is noted

Notes = dict[Note, Mapping[str, float]]


class Matrix(NamedTuple):
    """K by rows (9), and the notes on it."""

    values: tuple[float, ...]
    notes: Notes


def camera_matrix(document: Mapping[str, Any], names: Sequence[str]) -> Matrix | None:
    """K of the first of the fields that is there; None if none is.

    Raises:
        CalibrationFileError: it is no camera matrix, nor a transposed one.
    """
    values = field_numbers(document, names, (9, 12))
    if values is None:
        return None
    name = next(each for each in names if document.get(each) is not None)
    matrix = np.reshape(values, (3, -1))[:, :3]
    notes: Notes = {}
    if matrix[0, 2] == matrix[1, 2] == 0 and (matrix[2, :2] != 0).any():
        matrix, notes[Note.TRANSPOSED] = matrix.T, {}
    if not matrix[2, 2] or (matrix[2, :2] != 0).any() or matrix[1, 0] != 0:
        raise CalibrationFileError(
            f"{name}: must be fx 0 cx / 0 fy cy / 0 0 1 (got "
            f"{' / '.join(' '.join(f'{n:g}' for n in row) for row in matrix)})"
        )
    matrix = matrix / matrix[2, 2]
    if abs(matrix[0, 1]) > _SKEW_PX:
        notes[Note.SKEW] = {"px": float(matrix[0, 1])}
    return Matrix(values=tuple(matrix.ravel().tolist()), notes=notes)


def projection_of(model: str | None) -> Projection:
    """The projection by a tool's word for a distortion model.

    Raises:
        CalibrationFileError: it is none of ours.
    """
    word = (model or "none").strip().lower()
    if word in FISHEYES:
        return Projection.FISHEYE
    if word in _PERSPECTIVES:
        return Projection.PERSPECTIVE
    raise CalibrationFileError(
        f"distortion_model: must be {', '.join(_PERSPECTIVES[:-1])} or {', '.join(FISHEYES)} "
        f"(got {word!r:.40})"
    )


class Distortion(NamedTuple):
    """A projection with its coefficients in our order, and the notes on them."""

    projection: Projection
    values: tuple[float, ...]
    notes: Notes


def distortion_of(
    values: Sequence[float],
    projection: Projection,
    matrix: Sequence[float],
    size: tuple[int, int] | None,
) -> Distortion:
    """As many coefficients as the projection has.

    Raises:
        CalibrationFileError: another count, or a lens that none of ours describes.
    """
    if len(values) not in _COUNTS[projection]:
        wanted = " or ".join(map(str, _COUNTS[projection]))
        raise CalibrationFileError(f"distortion: must have {wanted} numbers (got {len(values)})")
    count = len(coefficients_of(projection))
    if not any(values[count:]):
        return Distortion(projection, (*values, 0.0, 0.0, 0.0, 0.0)[:count], {})
    fx, _, cx, _, fy, cy = matrix[:6]
    width, height = size or (2 * cx + 1, 2 * cy + 1)
    corner = math.hypot(max(cx, width - cx), max(cy, height - cy))
    try:
        ours = replaced(np.array(values), np.array([fx, fy]), corner)
    except ShapeError as error:
        raise CalibrationFileError(str(error)) from error
    most = _MOST_OFF_PX * width / 1920
    if ours.off_px > most:
        raise CalibrationFileError(
            f"distortion: {len(values)} coefficients must be within {most:.2g} px of five (k1, k2, "
            f"p1, p2, k3) or of four of a fisheye (got {ours.off_px:.2g} px). Calibrate again "
            "without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL, CALIB_TILTED_MODEL"
        )
    note = {"given": len(values), "taken": len(ours.distortion), "px": ours.off_px}
    return Distortion(ours.projection, ours.distortion, {Note.FEWER_COEFFICIENTS: note})
