"""Pictures that are drawn: a wall of blobs and lines, and it from a camera that turned."""

import cv2
import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose

LENS = Intrinsics(width=640, height=360, fx=500, fy=500, cx=319.5, cy=179.5)
PRIOR = CameraPose.of_degrees(height_m=5.0, tilt_deg=20.0, roll_deg=1.0, heading_deg=40.0)


def wall(seed=0, lens=LENS):
    """A picture full of things, of no repetition."""
    draw = np.random.default_rng(seed)
    grey = np.full((lens.height, lens.width), 110, np.uint8)
    for _ in range(500):
        x, y = (int(draw.integers(0, side)) for side in (lens.width, lens.height))
        w, h = (int(size) for size in draw.integers(3, 60, 2))
        shade = int(draw.integers(0, 255))
        if draw.random() < 0.5:
            cv2.rectangle(grey, (x, y), (x + w, y + h), shade, -1)
        else:
            cv2.circle(grey, (x, y), w // 2 + 2, shade, -1)
    return cv2.GaussianBlur(grey, (0, 0), 1.0)


def seen_after(grey, before, after, lens=LENS, zoom=1.0):
    """What a camera sees of far things after its pose changed in angles, by K R K^-1."""
    turn = after.rotation @ before.rotation.T
    warp = lens.matrix @ np.diag([zoom, zoom, 1.0]) @ turn @ np.linalg.inv(lens.matrix)
    return cv2.warpPerspective(grey, warp, (lens.width, lens.height), borderValue=90)
