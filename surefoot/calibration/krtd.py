"""KRTD files of KWIVER, VIRAT and MEVA: K, R, t and distortion as rows of numbers.

Source: KWIVER, `vital/io/camera_io.cxx`.
"""

from models.geometry.intrinsics import Projection
from surefoot.calibration.lens import camera_matrix, distortion_of
from surefoot.calibration.value import Calibration

_ROWS = 7  # of three numbers: K, R and t; the distortion comes after them


def read_krtd(text: str) -> Calibration | None:
    """The lens, without an image size, and the pose; None if the text is no KRTD file."""
    try:
        rows = [[float(part) for part in line.split()] for line in text.splitlines()]
    except ValueError:
        return None
    rows = [row for row in rows if row]
    if len(rows) < _ROWS or any(len(row) != 3 for row in rows[:_ROWS]):
        return None
    matrix = camera_matrix({"K": rows[:3]}, ("K",))
    assert matrix is not None
    given = [number for row in rows[_ROWS:] for number in row] or [0.0]
    lens = distortion_of(given, Projection.PERSPECTIVE, matrix.values, None)
    return Calibration(
        format="KRTD",
        matrix=matrix.values,
        projection=lens.projection,
        distortion=lens.values,
        rotation=tuple(number for row in rows[3:6] for number in row),
        translation_m=tuple(rows[6]),
        notes={**matrix.notes, **lens.notes},
    )
