"""A camera as OpenCV's `FileStorage` reads it, written by hand: cv2 stays out of this process."""

from collections.abc import Sequence

import numpy as np

from models.geometry.intrinsics import Intrinsics, Projection, coefficients_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array


def opencv_yaml(
    intrinsics: Intrinsics, pose: CameraPose, *, camera_id: str, words: Sequence[str]
) -> str:
    """The YAML of a camera at a pose, with the homographies of its ground plane.

    `P` is K [R | t]. A homography knows no distortion: `H_image_from_ground` takes (x, y, 1) in
    metres to undistorted pixels, `H_ground_from_image` takes those back.

    `words` are comments for the head of the file; line breaks in them are taken out.
    """
    rotation, translation = pose.rotation, pose.translation_m[:, None]
    projection = intrinsics.matrix @ np.hstack([rotation, translation])
    image_from_ground = projection[:, [0, 1, 3]]
    ground_from_image = np.asarray(np.linalg.inv(image_from_ground), dtype=np.float64)
    lines = ["%YAML:1.0", "---"]
    lines += [f"# {' '.join(word.split())}" for word in words]
    lines += [
        f'camera_id: "{camera_id}"',
        f"image_width: {intrinsics.width}",
        f"image_height: {intrinsics.height}",
        *_matrix("K", intrinsics.matrix),
        # As OpenCV's calibration sample says it: of a fisheye they are those of cv2.fisheye.
        f"fisheye_model: {int(intrinsics.projection is Projection.FISHEYE)}",
        f"# {', '.join(coefficients_of(intrinsics.projection))}",
        *_matrix("distortion", np.array([intrinsics.distortion])),
        "# x_camera = R x_world + t; metres, Z up, the ground is Z = 0",
        *_matrix("R", rotation),
        *_matrix("t", translation),
        "# K [R | t]",
        *_matrix("P", projection),
        "# between (x, y, 1) on the ground in metres and undistorted pixels (u, v, 1)",
        *_matrix("H_image_from_ground", image_from_ground),
        *_matrix("H_ground_from_image", ground_from_image),
    ]
    return "\n".join(lines) + "\n"


def yaml_number(value: float) -> str:
    """A number with a point: without one OpenCV reads an integer, and YAML 1.1 `1e-05` as text."""
    mantissa, e, exponent = repr(float(value)).partition("e")
    return mantissa + ("" if "." in mantissa else ".0") + e + exponent


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = values.shape
    numbers = [yaml_number(value) for value in values.ravel()]
    lines = [", ".join(numbers[at : at + columns]) for at in range(0, rows * columns, columns)]
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        "   data: [ " + ",\n       ".join(lines) + " ]",
    ]
