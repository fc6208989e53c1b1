"""Whether the corners of a zone are plausible pixels of the camera's image."""

from collections.abc import Sequence

import numpy as np

from models.geometry.rotation import Array

NARROWEST_PX = 1.0
_LARGEST_SHARE = 1.5  # shares of the image, -1 to 1 of Axis; some are a little outside the image
_LON_LAT = (180.0, 90.0)


def extent_fault(
    given: Sequence[tuple[float, float]],
    corners: Sequence[tuple[float, float]],
    picture: tuple[int, int],
) -> str | None:
    """Why a zone is rejected, and the fix; None for one that may lie in the image.

    Args:
        given: corners in the numbers of the document.
        corners: the same in pixels.
        picture: width and height of the image.
    """
    width, height = picture
    for corner, number in zip(corners, given, strict=True):
        if not all(-side <= x <= 2 * side for x, side in zip(corner, picture, strict=True)):
            needed = f"corners within one image size of the {width} x {height} px image are needed"
            return f"{needed}, got {number[0]:.6g}, {number[1]:.6g}"
    pixels, numbers = np.array(corners, dtype=np.float64), np.array(given, dtype=np.float64)
    unscaled = np.array_equal(pixels, numbers)
    narrow_px = _narrowest(pixels)
    if unscaled and (np.abs(numbers) <= _LARGEST_SHARE).all():
        fix = f'if these are shares of the {width} x {height} px image, send "normalised": true'
    elif narrow_px >= NARROWEST_PX:
        return None
    elif unscaled and (np.abs(numbers) <= _LON_LAT).all():
        fix = (
            "if these are longitude and latitude, draw the zone in pixels of the "
            f"{width} x {height} px image instead"
        )
    else:
        fix = "remove it, or draw it wider"
    return f"a zone at least {NARROWEST_PX:g} px wide is needed, got {narrow_px:.3g} px; {fix}"


def _narrowest(pixels: Array) -> float:
    """The length of a line, or the width of an area across its principal axis, in pixels."""
    if len(pixels) <= 2:
        return float(np.hypot(*np.ptp(pixels, axis=0)))
    _, axes = np.linalg.eigh(np.cov(pixels.T))  # the least variance first
    return float(np.ptp(pixels @ axes[:, 0]))
