"""A calibration file as a lens and a pose."""

from dataclasses import dataclass, replace

from models.errors import CalibrationError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.errors import MalformedError
from service.formats.calibration_file import read_calibration
from surefoot.calibration.value import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadCalibration:
    """What a file has: None for a lens or a pose that is not in it."""

    file: Calibration
    lens: Intrinsics | None
    pose: CameraPose | None


def read_camera(body: bytes, camera: str | None, size: tuple[int, int] | None) -> ReadCalibration:
    """The lens and the pose in a file; `size` (width, height) is taken if the file has none.

    Raises:
        MalformedError: the file is no calibration, has no image size, or no camera has such a lens
            or pose.
        OverloadedError: too many files are being read at once.
    """
    found = read_calibration(body, camera)
    if found.size is None:
        found = replace(found, size=size)
    try:
        return ReadCalibration(file=found, lens=found.lens, pose=found.pose)
    except CalibrationError as error:
        name, _, reason = str(error).partition(": ")
        raise MalformedError.of_field(name, reason) from error
