"""Other layouts of the same fields, brought to the names that `opencv` reads.

Source: ORB-SLAM's settings (`Camera.fx`), camodocal and VINS (`projection_parameters`), ROS' INI of
camera_calibration_parsers.
"""

import re
from typing import Any

from surefoot.calibration.value import CalibrationFileError

Document = dict[str, Any]

_SECTION = re.compile(r"\[(?P<name>[^\]]*)\]")
_INI_FIELDS = {
    "width": "image_width",
    "height": "image_height",
    "camera matrix": "camera_matrix",
    "distortion": "distortion_coefficients",
    "rectification": "rectification_matrix",
    "projection": "projection_matrix",
}
_KANNALA_BRANDT = {"mu": "fx", "mv": "fy", "u0": "cx", "v0": "cy"}


def nested(document: Document) -> Document:
    """The document with `Camera.fx` as fx of an object Camera."""
    found: Document = {}
    for name, value in document.items():
        head, dot, tail = name.partition(".")
        if dot and head and tail and isinstance(found.setdefault(head, {}), dict):
            found[head][tail] = value
        else:
            found[name] = value
    return found


def merged(document: Document) -> Document:
    """A camodocal camera with its two groups of parameters in one object.

    Raises:
        CalibrationFileError: it is of a model that is none of ours.
    """
    projection, distortion = (
        document.get(f"{name}_parameters") for name in ("projection", "distortion")
    )
    if not isinstance(projection, dict):
        return document
    model = str(document.get("model_type", "PINHOLE")).upper()
    if model == "KANNALA_BRANDT":
        lens = {ours: projection.get(theirs) for theirs, ours in _KANNALA_BRANDT.items()}
        coefficients = [projection.get(f"k{n}", 0.0) for n in (2, 3, 4, 5)]
        return {**document, **lens, "distortion": coefficients, "distortion_model": "fisheye"}
    if model != "PINHOLE":
        raise CalibrationFileError(
            f"model_type: must be PINHOLE or KANNALA_BRANDT (got {model!r:.40})"
        )
    return {**document, **projection, **(distortion if isinstance(distortion, dict) else {})}


def ros_ini(text: str) -> Document | None:
    """The fields of ROS' INI; None if the text is none."""
    if not _SECTION.match(text.lstrip()):
        return None
    found: Document = {}
    name: str | None = None
    for line in text.splitlines():
        stripped = line.strip()
        if stripped in _INI_FIELDS:
            name = _INI_FIELDS[stripped]
            found[name] = ""
        elif name is not None and stripped and not _SECTION.match(stripped):
            found[name] += f" {stripped}"
        elif stripped:
            name = None
    return found if "camera_matrix" in found else None
