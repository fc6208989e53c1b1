"""A camera as COLMAP's text model: `cameras.txt`, `images.txt` and an empty `points3D.txt`.

Source: COLMAP, "Output Format"; its camera models OPENCV, FULL_OPENCV and OPENCV_FISHEYE.
"""

import io
import zipfile

from models.geometry.intrinsics import Intrinsics, Projection
from models.geometry.pose import CameraPose

_PIXEL_CENTRE = 0.5  # of COLMAP's first pixel; ours is 0


def colmap_zip(intrinsics: Intrinsics, pose: CameraPose, *, camera_id: str) -> bytes:
    """A ZIP of the three files of a model with one image, `{camera_id}.jpg`.

    COLMAP's poses are `camera_from_world`, like ours. OPENCV has no k3: a lens with one is of
    FULL_OPENCV, whose k4, k5 and k6 are 0.
    """
    model, numbers = "OPENCV_FISHEYE", list(intrinsics.distortion)
    if intrinsics.projection is Projection.PERSPECTIVE:
        *numbers, k3 = intrinsics.distortion
        model, numbers = ("FULL_OPENCV", [*numbers, k3, 0, 0, 0]) if k3 else ("OPENCV", numbers)
    middle = (intrinsics.cx + _PIXEL_CENTRE, intrinsics.cy + _PIXEL_CENTRE)
    lens = _row(intrinsics.fx, intrinsics.fy, *middle, *numbers)
    stands = _row(*pose.quaternion_wxyz, *pose.translation_m)
    files = {
        "cameras.txt": f"1 {model} {intrinsics.width} {intrinsics.height} {lens}\n",
        "images.txt": f"1 {stands} 1 {camera_id}.jpg\n\n",  # the empty line: its points, none
        "points3D.txt": "",
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name), text)  # of 1980: the same pose, the same bytes
    return packed.getvalue()


def _row(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)
