"""A calibration as a file has it: a lens, a pose, or both, and what was not taken."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics, Projection
from models.geometry.lens_checks import check_lens
from models.geometry.pose import CameraPose, pose_from_matrices
from models.geometry.rotation import nearest_rotation


class Note(StrEnum):
    """What a reader did to a calibration, or did not take from it."""

    RECTIFICATION = "rectification"
    STEREO_PAIR = "stereo_pair"
    RIG = "rig"
    BOARDS = "boards"
    TRANSPOSED = "transposed"
    COUNTED_FROM_ONE = "counted_from_one"
    FEWER_COEFFICIENTS = "fewer_coefficients"
    SKEW = "skew"
    OWN_WORLD = "own_world"


class CalibrationFileError(ShapeError):
    """A file is no calibration, or one that cannot be taken; the message names the field."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibration of one camera; None where the file has no such numbers.

    `matrix` is K by rows (9), `rotation` by rows (9) and `translation_m` (3) are
    `camera_from_world`. `notes` has the numbers of each note.
    """

    format: str
    camera: str | None = None
    size: tuple[int, int] | None = None
    matrix: tuple[float, ...] | None = None
    projection: Projection = Projection.PERSPECTIVE
    distortion: tuple[float, ...] | None = None
    rotation: tuple[float, ...] | None = None
    translation_m: tuple[float, ...] | None = None
    notes: Mapping[Note, Mapping[str, float]] = field(default_factory=dict)

    @property
    def lens(self) -> Intrinsics | None:
        """The lens; None if the file has none.

        Raises:
            CalibrationFileError: the file has no image size.
            ShapeError: no camera has such a lens.
        """
        if self.matrix is None:
            return None
        if self.size is None:
            raise CalibrationFileError(
                f"width, height: are required, this {self.format} file has no image size"
            )
        fx, _, cx, _, fy, cy = self.matrix[:6]
        width, height = self.size
        return check_lens(
            Intrinsics(
                width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy,
                distortion=self.distortion or (), projection=self.projection,
            )
        )  # fmt: skip

    @property
    def pose(self) -> CameraPose | None:
        """The pose; None if the file has none.

        Raises:
            ShapeError: the rotation is none, or the camera is not above the ground.
        """
        if self.rotation is None or self.translation_m is None:
            return None
        rotation = nearest_rotation(np.reshape(self.rotation, (3, 3)))
        return pose_from_matrices(rotation, np.array(self.translation_m))
