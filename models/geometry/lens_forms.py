"""A lens as installers know it: by its field of view, by millimetres, or as a fisheye."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics, Projection

_FORMS = (["hfov_deg"], ["focal_mm", "sensor_mm"], ["fisheye"])


def lens_of(
    *,
    width: int,
    height: int,
    hfov_deg: float | None = None,
    focal_mm: float | None = None,
    sensor_mm: Sequence[float] | None = None,
    fisheye: Mapping[str, Any] | None = None,
) -> Intrinsics:
    """The lens in pixels, of a picture of that size.

    `hfov_deg` is from the left edge of the picture to the right, `sensor_mm` the sensor's width and
    height; both forms are without distortion. `fisheye` has `fx` and perhaps `fy` (square pixels),
    `cx`, `cy` (the middle) and `distortion`, k1 to k4 of `cv2.fisheye`.

    Raises:
        ShapeError: not one of the three is given, or it makes no lens.
    """
    told = {
        "hfov_deg": hfov_deg, "focal_mm": focal_mm, "sensor_mm": sensor_mm, "fisheye": fisheye
    }  # fmt: skip
    given = [name for name, value in told.items() if value is not None]
    if given not in _FORMS:
        raise ShapeError(
            "lens: either hfov_deg, or focal_mm and sensor_mm, or fisheye is needed; "
            f"got {', '.join(given) or 'none'}"
        )
    if hfov_deg is not None:
        return Intrinsics.of_view(width=width, height=height, hfov_rad=math.radians(hfov_deg))
    if focal_mm is not None and sensor_mm is not None:
        wide, tall = sensor_mm
        return Intrinsics.of_sensor(
            width=width, height=height, focal_mm=focal_mm, sensor_mm=(wide, tall)
        )
    assert fisheye is not None
    said = {name: value for name, value in fisheye.items() if value is not None}
    middle = {"cx": (width - 1) / 2, "cy": (height - 1) / 2}
    whole: dict[str, Any] = {"fy": said.get("fx"), **middle, **said}
    return Intrinsics(width=width, height=height, projection=Projection.FISHEYE, **whole)
