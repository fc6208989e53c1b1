"""Kalibr's camchain and sensor files: `intrinsics` [fu, fv, pu, pv], distortion, resolution.

Source: Kalibr wiki, "YAML formats" and "Supported models".
"""

from collections.abc import Mapping
from typing import Any

from surefoot.calibration.fields import field_numbers, image_size, named
from surefoot.calibration.lens import Notes, distortion_of, projection_of
from surefoot.calibration.value import Calibration, CalibrationFileError, Note

_COEFFICIENTS = ("distortion_coeffs", "distortion_coefficients")
_RIG = ("T_cam_imu", "T_cn_cnm1", "T_BS", "T_imu_cam")


def is_kalibr(document: Mapping[str, Any]) -> bool:
    """True of one camera of a camchain."""
    return {"camera_model", "intrinsics"} <= document.keys()


def read_kalibr(document: Mapping[str, Any]) -> Calibration:
    """The lens of one camera.

    Raises:
        CalibrationFileError: the model is none of ours, or a field is damaged.
    """
    if document["camera_model"] != "pinhole":
        raise CalibrationFileError(
            f"camera_model: must be pinhole (got {document['camera_model']!r:.40})"
        )
    numbers = field_numbers(document, ("intrinsics",), (4,))
    assert numbers is not None
    fx, fy, cx, cy = numbers
    matrix = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    size = image_size(document)
    model = document.get("distortion_model")
    projection = projection_of(model if isinstance(model, str) else None)
    given = field_numbers(document, _COEFFICIENTS, range(1, 15)) or [0.0] * 4
    lens = distortion_of(given, projection, matrix, size)
    notes: Notes = dict(lens.notes)
    if named(document, _RIG):
        notes[Note.RIG] = {}
    return Calibration(
        format="Kalibr",
        size=size,
        matrix=matrix,
        projection=lens.projection,
        distortion=lens.values,
        notes=notes,
    )
