"""Checks of a registered lens: errors that no camera can have, and likely mistakes.

Lenses are checked where a person or a program gives them, not in `Intrinsics`: estimators try
lenses that are never registered.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics, Projection

# Shares of the image's width and height. Published lenses: at most 0.10 and 0.16 (WILDTRACK c6),
# 0.24 of the height where a stream is cropped from a taller one (Waymo's side cameras). A
# principal point of a stream 1.5 times as large is 0.25 of both off.
_OFF_CENTRE = (0.2, 0.25)
_CENTRED = 0.1  # share of a side: what a corrected reading has to reach to be proposed
_CORNER = 0.05  # share of a side
_SAME_SCALE = 0.06  # relative: the principal point is off by the same factor in x and y
# fx / fy. Published: 1.43 (MEVA G436), 1.46 (16:9 stored as 704 x 576), 0.68 (16:9 as 480 x 480).
_USUAL_ASPECT, _MOST_ASPECT = 1.5, 5.0
# Of half the image's shorter side. Calibrations are free to fold beyond the last board that was
# seen, in the corners (a GoPro's and a 97 deg webcam's at 1.6). A fisheye's image circle may be
# smaller than the image.
_LEAST_REACH = {Projection.PERSPECTIVE: 1.0, Projection.FISHEYE: 0.5}
_MOST_WITHOUT_RAY = 0.2  # share of the image of a perspective lens; published wide ones to 0.17
_USUAL_TANGENTIAL = 0.05  # of p1 and p2: published ones are below 0.02, k3 is often above 0.05
_SIDES = 8  # pixels: the sides of usual streams are multiples
_GRID = 41  # pixels a side


class LensDoubt(StrEnum):
    """Likely mistakes in a lens."""

    CORNER = "corner"
    OTHER_SIZE = "other_size"
    SWAPPED = "swapped"
    OFF_CENTRE = "off_centre"
    ASPECT = "aspect"
    FOLDS = "folds"
    TANGENTIAL = "tangential"


@dataclass(frozen=True, slots=True, kw_only=True)
class LensQuestion:
    """A likely mistake: the field at fault, and the numbers that it is judged by."""

    doubt: LensDoubt
    field: str
    values: dict[str, float]


def check_lens(lens: Intrinsics) -> Intrinsics:
    """Return the lens if a camera can have it.

    Raises:
        ShapeError: the principal point is outside the image, fx and fy differ by more than a
            factor of 5, or the distortion folds back near the centre.
    """
    for name, value, side in (("cx", lens.cx, lens.width), ("cy", lens.cy, lens.height)):
        if not -0.5 <= value <= side - 0.5:
            raise ShapeError(
                f"{name}: must be within the image, -0.5 to {side - 0.5:g} px (got {value:g})"
                f"{_of_other_size(lens)}"
            )
    if not 1 / _MOST_ASPECT <= lens.fx / lens.fy <= _MOST_ASPECT:
        raise ShapeError(
            f"fy: must be from {lens.fx / _MOST_ASPECT:g} to {lens.fx * _MOST_ASPECT:g} px, within "
            f"a factor of {_MOST_ASPECT:g} of fx (got {lens.fy:g})"
        )
    half = min(lens.width, lens.height) / 2
    least, reach = _LEAST_REACH[lens.projection] * half, fold_px(lens)
    if reach < least:
        raise ShapeError(
            f"distortion: must not fold back within {least:g} px of the principal point (got a "
            f"fold at {reach:.0f} px; pixels beyond it have no viewing ray)"
        )
    return lens


def lens_questions(lens: Intrinsics) -> list[LensQuestion]:
    """Likely mistakes in a lens that passes `check_lens`."""
    found = [*_centre_questions(lens)]
    if not 1 / _USUAL_ASPECT <= lens.fx / lens.fy <= _USUAL_ASPECT:
        found.append(_question(LensDoubt.ASPECT, "fy", ratio=lens.fx / lens.fy))
    if lens.projection is Projection.PERSPECTIVE:
        tangential = max(map(abs, lens.distortion[2:4]))
        if tangential > _USUAL_TANGENTIAL:
            found.append(_question(LensDoubt.TANGENTIAL, "distortion", value=tangential))
        share = _share_without_ray(lens)
        if share > _MOST_WITHOUT_RAY:
            found.append(
                _question(LensDoubt.FOLDS, "distortion", percent=100 * share, px=fold_px(lens))
            )
    return found


def fold_px(lens: Intrinsics) -> float:
    """Distance from the principal point at which the distortion folds back; infinite if nowhere."""
    return min(lens.fx, lens.fy) * lens.fold_radius


def _question(doubt: LensDoubt, at: str, **values: float) -> LensQuestion:
    return LensQuestion(doubt=doubt, field=at, values=values)


def _centre_questions(lens: Intrinsics) -> list[LensQuestion]:
    off_x, off_y = _off_centre(lens.cx, lens.cy, lens.width, lens.height)
    off_side = [off_x > _OFF_CENTRE[0], off_y > _OFF_CENTRE[1]]
    place = {"cx": lens.cx, "cy": lens.cy}
    width, height = _other_size(lens)
    if width:
        return [_question(LensDoubt.OTHER_SIZE, "cx", **place, width=width, height=height)]
    if not any(off_side):
        return []
    if 0.5 - min(off_x, off_y) < _CORNER:
        return [_question(LensDoubt.CORNER, "cx", **place)]
    if max(_off_centre(lens.cx, lens.cy, lens.height, lens.width)) < _CENTRED:
        return [_question(LensDoubt.SWAPPED, "width", **place)]
    return [_question(LensDoubt.OFF_CENTRE, "cx" if off_side[0] else "cy", **place)]


def _off_centre(cx: float, cy: float, width: float, height: float) -> tuple[float, float]:
    """Distances from the middle as shares of the sides."""
    return abs((cx + 0.5) / width - 0.5), abs((cy + 0.5) / height - 0.5)


def _other_size(lens: Intrinsics) -> tuple[int, int]:
    """The image size (width, height) with its centre at the principal point; 0, 0 if none fits.

    A lens that is cropped off the middle is not off by the same factor in x and in y.
    """
    by_x, by_y = 2 * (lens.cx + 0.5) / lens.width, 2 * (lens.cy + 0.5) / lens.height
    scale = (by_x + by_y) / 2
    near = abs(scale - 1) < 2 * _OFF_CENTRE[0]
    if near or scale < 0.1 or abs(by_x - by_y) > _SAME_SCALE * scale:
        return 0, 0
    width, height = (_SIDES * round(n * scale / _SIDES) for n in (lens.width, lens.height))
    return width, height


def _of_other_size(lens: Intrinsics) -> str:
    width, height = _other_size(lens)
    return f"; the lens appears to be of an image of {width} x {height}" if width else ""


def _share_without_ray(lens: Intrinsics) -> float:
    across, down = (np.linspace(0, side - 1, _GRID) for side in (lens.width, lens.height))
    _, valid = lens.rays(np.stack(np.meshgrid(across, down), axis=-1))
    return float(1 - valid.mean())
