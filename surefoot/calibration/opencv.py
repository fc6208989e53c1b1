"""Calibrations by OpenCV's names: FileStorage, Python, ROS camera_info, stereo pairs, MATLAB.

Source: OpenCV's calibration samples, camera_calibration_parsers and sensor_msgs/CameraInfo of ROS,
MATLAB's cameraParameters and cameraIntrinsicsToOpenCV.
"""

from collections.abc import Mapping
from typing import Any

from models.geometry.intrinsics import Projection
from models.geometry.rotation import rotation_from_vector
from surefoot.calibration.fields import field_numbers, image_size, named, numbers
from surefoot.calibration.lens import (
    FISHEYES,
    OTHERS,
    Notes,
    camera_matrix,
    distortion_of,
    projection_of,
)
from surefoot.calibration.value import Calibration, Note

Document = Mapping[str, Any]

_MATRICES = (
    "camera_matrix", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "K", "k", "mtx", "K1", "M1",
    "cameraMatrix1", "CameraMatrix1", "camera_matrix_1", "IntrinsicMatrix", "IntrinsicMatrix1",
    "intrinsicMatrix", "intrinsic_matrix", "intrinsics", "M", "camera_matrix_row_major",
)  # fmt: skip
_DISTORTIONS = (
    "distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs", "dist_coeff",
    "dist_coefs", "distortion_coeffs", "distortion", "dist", "D", "d", "D1", "distCoeffs1",
    "coeffs",
)  # fmt: skip
_ROTATIONS = ("R", "rotation", "rotation_matrix", "rotationMatrix", "rvec")
_TRANSLATIONS = ("t", "T", "translation", "translation_vector", "tvec")
_BOARDS = ("rvecs", "tvecs", "rotation_vectors", "translation_vectors", "extrinsics",
           "extrinsic_parameters", "Extrinsic_Parameters")  # fmt: skip
_SECOND = ("K2", "M2", "D2", "cameraMatrix2", "CameraMatrix2", "camera_matrix_2",
           "IntrinsicMatrix2", "R1", "R2", "P1", "P2", "Q", "E", "F")  # fmt: skip
_RECTIFIED = ("rectification_matrix", "projection_matrix", "P", "p")
_CENTRES = {"cx": ("cx", "ppx", "u0", "c_x"), "cy": ("cy", "ppy", "v0", "c_y")}
_FOCALS = {"fx": ("fx", "fl_x", "f_x", "focal_x"), "fy": ("fy", "fl_y", "f_y", "focal_y")}
_TERMS = ("k1", "k2", "p1", "p2", "k3")
_FISHEYE_TERMS = ("k1", "k2", "k3", "k4")
# Names that are as often of a device: of these only known words count.
_MODELS = ("model", "camera_model", "projection", "lens_model", "type", "model_type")


def is_opencv(document: Document) -> bool:
    """True of an object that has the lens or the pose of a camera."""
    return _has_matrix(document) or _is_flat(document) or named(document, _ROTATIONS) is not None


def kind_of(document: Document, notation: str) -> str:
    """The tool that such an object is of, for people."""
    if "IntrinsicMatrix" in document and "RadialDistortion" in document:
        return "MATLAB cameraParameters"
    if _is_flat(document):
        return f"{notation} with fx, fy, cx, cy"
    return "ROS camera_info" if _is_ros(document) else f"OpenCV {notation}"


def read_opencv(document: Document, notation: str) -> Calibration:
    """The calibration in an object of any of these tools.

    Raises:
        CalibrationFileError: naming the field, its limit and the value.
    """
    if "IntrinsicMatrix" in document and "RadialDistortion" in document:
        return _matlab(document)
    if _is_flat(document):
        return _flat(document, notation)
    ros = _is_ros(document)
    found = camera_matrix(document, _MATRICES) if _has_matrix(document) else None
    size = image_size(document)
    projection = _projection(document)
    given = field_numbers(document, _DISTORTIONS, range(1, 15))
    notes: Notes = {} if found is None else found.notes
    distortion: tuple[float, ...] | None = None
    if given and found is not None:
        lens = distortion_of(given, projection, found.values, size)
        projection, distortion, notes = lens.projection, lens.values, notes | lens.notes
    rotation, translation = _pose(document, ros=ros, notes=notes)
    return Calibration(
        format=kind_of(document, notation),
        size=size,
        matrix=None if found is None else found.values,
        projection=projection,
        distortion=distortion,
        rotation=rotation,
        translation_m=translation,
        notes=notes,
    )


def _is_flat(document: Document) -> bool:
    return bool(named(document, _FOCALS["fx"]) and named(document, _CENTRES["cx"]))


def _has_matrix(document: Document) -> bool:
    """True where the first name of a matrix has one, and not the lenses of a rig."""
    name = named(document, _MATRICES)
    return name is not None and not (
        isinstance(document[name], Mapping) and "data" not in document[name]
    )


def _projection(document: Document) -> Projection:
    """The projection by OpenCV's flag, by `distortion_model`, or by a known word for a model.

    Raises:
        CalibrationFileError: the distortion model is none of ours.
    """
    flag = numbers(document.get("fisheye_model"))
    if (flag and flag[0]) or str(document.get("is_fisheye")).lower() == "true":
        return Projection.FISHEYE
    given = document.get("distortion_model")
    if isinstance(given, str):
        return projection_of(given)
    words = [document[name] for name in _MODELS if isinstance(document.get(name), str)]
    for word in (each.rpartition(".")[2].strip().lower() for each in words):
        if word in FISHEYES or word in OTHERS:
            return projection_of(word)
    return Projection.PERSPECTIVE


def _is_ros(document: Document) -> bool:
    """True of a CameraInfo: R is a rectification there, and T is not there."""
    return named(document, _RECTIFIED) is not None and (
        named(document, _TRANSLATIONS) is None or "distortion_model" in document
    )


def _pose(
    document: Document, *, ros: bool, notes: Notes
) -> tuple[tuple[float, ...] | None, tuple[float, ...] | None]:
    """R and t in the world, and notes on those that are not."""
    if named(document, _BOARDS):
        notes[Note.BOARDS] = {}
    name = named(document, (*_ROTATIONS, "r"))
    if name is None:
        return None, None
    if ros:
        notes[Note.RECTIFICATION] = {}
        return None, None
    if named(document, _SECOND):
        notes[Note.STEREO_PAIR] = {}
        return None, None
    rotation = field_numbers(document, _ROTATIONS, (3, 9))
    translation = field_numbers(document, _TRANSLATIONS, (3,))
    if rotation is not None and len(rotation) == 3:
        rotation = rotation_from_vector(rotation).ravel().tolist()
    return _tuple(rotation), _tuple(translation)


def _tuple(values: list[float] | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(values)


def _matlab(document: Document) -> Calibration:
    found = camera_matrix(document, ("IntrinsicMatrix", "K"))
    assert found is not None
    values = list(found.values)
    values[2], values[5] = values[2] - 1, values[5] - 1
    radial = field_numbers(document, ("RadialDistortion",), (1, 2, 3)) or []
    tangential = field_numbers(document, ("TangentialDistortion",), (2,)) or [0.0, 0.0]
    k1, k2, k3 = (*radial, 0.0, 0.0)[:3]
    rows = numbers(document.get("ImageSize"))
    return Calibration(
        format=kind_of(document, ""),
        size=(round(rows[1]), round(rows[0])) if rows and len(rows) == 2 else None,
        matrix=tuple(values),
        distortion=(k1, k2, *tangential, k3),
        notes={**found.notes, Note.COUNTED_FROM_ONE: {}},
    )


def _flat(document: Document, notation: str) -> Calibration:
    """fx, fy, cx and cy by their names, as SDKs of cameras write them."""
    fx, fy, cx, cy = (
        (field_numbers(document, names, (1,)) or [0.0])[0]
        for names in (*_FOCALS.values(), *_CENTRES.values())
    )
    matrix = (fx, 0.0, cx, 0.0, fy or fx, cy, 0.0, 0.0, 1.0)
    size = image_size(document)
    given = field_numbers(document, _DISTORTIONS, range(1, 15))
    # RealSense names a model that is none of ours beside five zeros.
    projection = Projection.PERSPECTIVE
    if given is None or any(given) or len(given) == 4:
        projection = _projection(document)
    terms = _FISHEYE_TERMS if projection is Projection.FISHEYE else _TERMS
    if given is None and named(document, terms):
        given = [(field_numbers(document, (term,), (1,)) or [0.0])[0] for term in terms]
    lens = None if given is None else distortion_of(given, projection, matrix, size)
    notes: Notes = {} if lens is None else lens.notes
    rotation, translation = _pose(document, ros=False, notes=notes)
    return Calibration(
        format=kind_of(document, notation),
        size=size,
        matrix=matrix,
        projection=projection if lens is None else lens.projection,
        distortion=None if lens is None else lens.values,
        rotation=rotation,
        translation_m=translation,
        notes=notes,
    )
