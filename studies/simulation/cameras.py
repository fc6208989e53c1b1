"""Cameras as there are: lenses, heights, tilts and rolls, drawn by a seed."""

import math
from dataclasses import dataclass

import numpy as np

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from studies.simulation.crowds import any_pixel

_SIZES = ((640, 480), (768, 576), (1280, 720), (1920, 1080), (1920, 1440))
_LEAST_SEEN = 0.3  # of the picture shows ground within reach
_PROBES = 200
_MOST_DRAWS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRange:
    """Ranges of drawn cameras; even between two ends, heights evenly in their log.

    `view_rad` is the angle that the picture is wide, `bent` by how much of its distance from the
    middle its left edge is moved by distortion; `roll_sd_rad` is a standard deviation.
    """

    height_m: tuple[float, float] = (1.8, 15.0)
    tilt_rad: tuple[float, float] = (math.radians(4), math.radians(65))
    roll_sd_rad: float = math.radians(2.5)
    view_rad: tuple[float, float] = (math.radians(30), math.radians(100))
    bent: tuple[float, float] = (-0.1, 0.03)
    farthest_m: float = 60.0


def draw_camera(cameras: CameraRange, rng: np.random.Generator) -> tuple[Intrinsics, CameraPose]:
    """A lens and a pose, heading along +Y, that show enough ground for people to walk on.

    Raises:
        DegenerateGeometryError: a range in which hardly any camera does.
    """
    for _ in range(_MOST_DRAWS):
        width, height = _SIZES[rng.integers(len(_SIZES))]
        half = math.tan(rng.uniform(*cameras.view_rad) / 2)
        focal = width / 2 / half
        lens = Intrinsics(
            width=width,
            height=height,
            fx=focal,
            fy=focal,
            cx=(width - 1) / 2,
            cy=(height - 1) / 2,
            distortion=(rng.uniform(*cameras.bent) / half**2, 0.0, 0.0, 0.0, 0.0),
        )
        pose = CameraPose(
            height_m=math.exp(rng.uniform(*np.log(cameras.height_m))),
            tilt_rad=rng.uniform(*cameras.tilt_rad),
            roll_rad=rng.normal(0, cameras.roll_sd_rad),
        )
        pixels = any_pixel(lens, (_PROBES, 1), rng)[:, 0]
        ground, valid = ground_from_pixel(lens, pose.rotation, pose.centre_m, pixels)
        near = np.linalg.norm(ground - pose.centre_m[:2], axis=-1) < cameras.farthest_m
        if (valid & near).mean() >= _LEAST_SEEN:
            return lens, pose
    raise DegenerateGeometryError(f"cameras: none of {_MOST_DRAWS} draws sees enough ground")
