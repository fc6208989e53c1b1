"""Cameras, poses and image points for property tests."""

import math

import numpy as np
from hypothesis import strategies as st

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Finite floats of a closed range."""
    return st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)


def angles(low_deg: float, high_deg: float) -> st.SearchStrategy[float]:
    """Radians of a range given in degrees."""
    return numbers(low_deg, high_deg).map(math.radians)


@st.composite
def intrinsics(draw: st.DrawFn, distorted: bool = True) -> Intrinsics:
    """Lenses from wide (80 deg) to long, off centre, with mild distortion of either sign."""
    width, height = draw(st.integers(320, 3840)), draw(st.integers(240, 2160))
    fx = width * draw(numbers(0.6, 3.0))
    coefficients = (0.3, 0.2, 0.005, 0.005, 0.05)
    return Intrinsics(
        width=width,
        height=height,
        fx=fx,
        fy=fx * draw(numbers(0.9, 1.1)),
        cx=width * draw(numbers(0.4, 0.6)),
        cy=height * draw(numbers(0.4, 0.6)),
        distortion=tuple(
            draw(numbers(-limit, limit)) if distorted else 0.0 for limit in coefficients
        ),  # fmt: skip
    )


@st.composite
def poses(draw: st.DrawFn, lowest_tilt_deg: float = -20.0) -> CameraPose:
    """Poses from looking up to looking straight down, with any roll and heading."""
    return CameraPose(
        height_m=draw(numbers(0.5, 30)),
        tilt_rad=draw(angles(lowest_tilt_deg, 90)),
        roll_rad=draw(angles(-180, 180)),
        heading_rad=draw(angles(-180, 180)),
        x_m=draw(numbers(-100, 100)),
        y_m=draw(numbers(-100, 100)),
    )


@st.composite
def image_points(draw: st.DrawFn, lens: Intrinsics, least: int = 1, most: int = 12) -> Array:
    """Pixels (N, 2) inside the image of a lens."""
    point = st.tuples(numbers(-0.5, lens.width - 0.5), numbers(-0.5, lens.height - 0.5))
    return np.array(draw(st.lists(point, min_size=least, max_size=most)))


@st.composite
def seen_points(draw: st.DrawFn, distorted: bool = True) -> tuple[Intrinsics, Array]:
    """A lens and pixels inside its image."""
    lens = draw(intrinsics(distorted=distorted))
    return lens, draw(image_points(lens))
