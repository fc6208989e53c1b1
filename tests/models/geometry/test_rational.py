"""Lenses of 8 to 14 coefficients and their replacements, by `cv2.projectPoints`."""

import math

import cv2
import numpy as np
import pytest

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics, Projection
from models.geometry.rational import replaced

WIDTH, HEIGHT = 250, 250
OAKD = [-3.4751670360565186, -38.5734748840332, 3.4309603506699204e-4, -9.377215610584244e-5,
        286.4400939941406, -3.6408045291900635, -36.68898010253906, 279.0523681640625]  # fmt: skip
# TIER IV's C1 of 120 deg, 2880 x 1860.
WIDE = [0.929988205433, 0.165922805667, -2.4369263e-5, -1.3859207e-5, 2.885974478e-3,
        1.331432461739, 0.435830116272, 2.7607271448e-2]  # fmt: skip


@pytest.mark.parametrize(
    ("coefficients", "size", "focal", "projection", "most_px"),
    [
        (OAKD, (250, 250), 202.62, Projection.PERSPECTIVE, 0.1),
        ([*OAKD, 1e-3, 0.0, -1e-3, 0.0], (250, 250), 202.62, Projection.PERSPECTIVE, 0.5),
        (WIDE, (2880, 1860), 1495.3, Projection.FISHEYE, 4.0),
    ],
)
def test_replacement_projects_as_opencv_does(coefficients, size, focal, projection, most_px):
    width, height = size
    corner = math.hypot(width / 2, height / 2)
    ours = replaced(np.array(coefficients), np.array([focal, focal]), corner)
    assert ours.projection == projection
    assert ours.off_px < most_px
    lens = Intrinsics(
        width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2,
        distortion=ours.distortion, projection=projection,
    )  # fmt: skip
    uv = np.stack(np.meshgrid(np.linspace(5, width - 6, 9), np.linspace(5, height - 6, 9)), -1)
    rays, valid = lens.rays(uv.reshape(-1, 2))
    assert valid.all()
    none = np.zeros(3)
    seen, _ = cv2.projectPoints(rays, none, none, lens.matrix, np.array(coefficients))
    assert np.hypot(*(seen[:, 0] - uv.reshape(-1, 2)).T).max() < most_px


@pytest.mark.parametrize(
    ("coefficients", "reason"),
    [
        ([0.1] * 6, r"must have 8, 12 or 14 numbers \(got 6\)"),
        ([*OAKD, 0, 0, 0, 0, 0.01, 0], r"tau_x and tau_y of a tilted sensor must be 0 \(got 0.01"),
        (
            [-2.0, 0, 0, 0, 0, 0.01, 0, 0],
            r"not fold back within 0.436 .* \(got a fold at 0.27",
        ),
    ],
)
def test_lens_without_replacement_is_rejected(coefficients, reason):
    with pytest.raises(ShapeError, match=reason):
        replaced(np.array(coefficients), np.array([202.62, 202.62]), math.hypot(125, 125))
