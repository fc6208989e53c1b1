"""The one reader of calibration files: it recognises the format and names it in its errors."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from models.errors import ShapeError
from models.geometry.rotation import rotation_from_quaternion
from surefoot.calibration.colmap import chosen_of, read_colmap
from surefoot.calibration.dialects import merged, nested, ros_ini
from surefoot.calibration.documents import (
    Document,
    archive_entries,
    array_document,
    check_size,
    documents,
)
from surefoot.calibration.fields import field_numbers
from surefoot.calibration.kalibr import is_kalibr, read_kalibr
from surefoot.calibration.krtd import read_krtd
from surefoot.calibration.nvidia import read_nvidia, sensors_of
from surefoot.calibration.opencv import is_opencv, kind_of, read_opencv
from surefoot.calibration.tsai import is_tsai, read_tsai
from surefoot.calibration.value import Calibration, CalibrationFileError
from surefoot.camera import camera_of, is_registration

FORMATS = (
    "OpenCV or Python (YAML, XML, JSON, .npz), ROS camera_info, Kalibr, MATLAB, COLMAP "
    "(cameras.txt, or with images.txt in a ZIP), NVIDIA calibration.json, KRTD, Tsai XML"
)
_DEEPEST = 3  # objects in each other in which a camera is looked for
_COLMAP = ("cameras.txt", "images.txt")


def read_calibration_file(body: bytes, camera: str | None = None) -> Calibration:
    """The calibration of a camera in a file.

    Args:
        body: the file's bytes.
        camera: the camera's name in a file of several.

    Raises:
        CalibrationFileError: the file is no calibration, or damaged; the message names the format
            that was recognised, the field, its limit and the value.
    """
    check_size(body)
    if body.startswith(b"PK\x03\x04"):
        return _of_archive(archive_entries(body), camera)
    text = body.decode("utf-8", errors="replace")
    if (files := _colmap_text(text)) is not None:
        with _named("COLMAP"):
            return read_colmap(files, camera)
    with _named("KRTD"):
        krtd = read_krtd(text)
    if krtd is not None:
        return krtd
    if (ini := ros_ini(text)) is not None:
        return _of_document(ini, "INI", camera)
    notation, found = documents(text)
    if not found:
        raise CalibrationFileError(f"file: must be a calibration, {FORMATS} (got other text)")
    calibration = _of_document(found[0], notation, camera)
    stamped = [each for each in found[1:] if "pose" in each]
    if calibration.format == "ROS camera_info" and stamped:
        with _named("ROS PoseStamped"):
            return _with_stamped(calibration, stamped[0])
    return calibration


@contextmanager
def _named(kind: str) -> Iterator[None]:
    """Begin the errors of a reader with the format."""
    try:
        yield
    except CalibrationFileError as error:
        raise CalibrationFileError(f"{kind}: {error}") from error


def _of_archive(entries: dict[str, bytes], camera: str | None) -> Calibration:
    if "cameras.txt" in entries:
        files = {
            name: entries[name].decode("utf-8", "replace") for name in _COLMAP if name in entries
        }
        with _named("COLMAP"):
            return read_colmap(files, camera)
    if "cameras.bin" in entries:
        raise CalibrationFileError(
            "COLMAP: must be a text model (got a binary one); convert it by colmap "
            "model_converter --output_type TXT"
        )
    if entries and all(name.endswith(".npy") for name in entries):
        with _named("NumPy .npz"):
            arrays = array_document(entries)
        return _of_document(arrays, ".npz", camera)
    if len(entries) == 1:
        return read_calibration_file(next(iter(entries.values())), camera)
    raise CalibrationFileError(
        f"file: a ZIP must have cameras.txt and images.txt of COLMAP, or one calibration (got "
        f"{', '.join(list(entries)[:8]) or 'no file'})"
    )


def _colmap_text(text: str) -> dict[str, str] | None:
    """COLMAP's `cameras.txt` by its lines: a number, and a model in capitals."""
    lines = [line.split() for line in text.splitlines() if line.strip() and line[:1] != "#"]
    rows = [row for row in lines if len(row) > 4 and row[0].isdigit() and row[2].isdigit()]
    if not lines or len(rows) < len(lines) or not all(row[1].isupper() for row in rows):
        return None
    return {"cameras.txt": text}


def _of_document(document: Document, notation: str, camera: str | None) -> Calibration:
    with _named("NVIDIA calibration.json"):
        sensors = sensors_of(document)
        if sensors is not None:
            kind = document.get("calibrationType")
            return read_nvidia(chosen_of(sensors, camera), kind)
    if is_registration(document) and {"prior_pose", "true_pose"} & document.keys():
        return _registered(document)
    found = _cameras(nested(document), _DEEPEST)
    if not found:
        raise CalibrationFileError(
            f"file: must have a camera matrix (camera_matrix, mtx, K) or a rotation (R, rvec), got "
            f"{notation} with {', '.join(list(document)[:8]) or 'nothing'}"
        )
    chosen = chosen_of(found, camera)
    if is_tsai(chosen):
        with _named("Tsai XML"):
            return read_tsai(chosen)
    if is_kalibr(chosen):
        with _named("Kalibr"):
            return read_kalibr(chosen)
    with _named(kind_of(chosen, notation)):
        return read_opencv(chosen, notation)


def _cameras(document: Document, deepest: int) -> dict[str, Document]:
    """The objects of cameras in a document by their names; the document itself by ""."""
    with _named("camodocal"):
        document = merged(document)
    if is_tsai(document) or is_kalibr(document) or is_opencv(document):
        return {"": document}
    found: dict[str, Document] = {}
    for name, part in document.items():
        if isinstance(part, dict) and deepest:
            for inner, each in _cameras(part, deepest - 1).items():
                found[f"{name}/{inner}".rstrip("/")] = each
    return found


def _registered(document: Document) -> Calibration:
    """A camera in the form of a registration over HTTP."""
    try:
        given = camera_of(document)
    except ShapeError as error:
        raise CalibrationFileError(f"Surefoot: {error}") from error
    lens, pose = given.intrinsics, given.prior_pose.in_radians
    return Calibration(
        format="Surefoot",
        size=(lens.width, lens.height),
        matrix=tuple(lens.matrix.ravel().tolist()),
        projection=lens.projection,
        distortion=lens.distortion,
        rotation=tuple(pose.rotation.ravel().tolist()),
        translation_m=tuple(pose.translation_m.tolist()),
    )


def _with_stamped(calibration: Calibration, document: Document) -> Calibration:
    """The pose of a PoseStamped in `map`, the frame with Z up: where the optical frame is."""
    header, pose = document.get("header"), document["pose"]
    frame = header.get("frame_id") if isinstance(header, dict) else None
    if frame != "map" or not isinstance(pose, dict):
        return calibration
    place, turn = (pose.get(name) for name in ("position", "orientation"))
    if not (isinstance(place, dict) and isinstance(turn, dict)):
        raise CalibrationFileError("pose: must have a position and an orientation")
    x, y, z, w = ((field_numbers(turn, (name,), (1,)) or [0.0])[0] for name in "xyzw")
    centre = [(field_numbers(place, (name,), (1,)) or [0.0])[0] for name in "xyz"]
    rotation = rotation_from_quaternion([w, -x, -y, -z])
    return replace(
        calibration,
        rotation=tuple(rotation.ravel().tolist()),
        translation_m=tuple((-rotation @ centre).tolist()),
    )
