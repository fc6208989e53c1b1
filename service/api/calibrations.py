"""`/calibrations`: a calibration file, in the form that `POST /cameras` takes."""

from dataclasses import asdict
from typing import Annotated, Any, Self

from fastapi import APIRouter, Query
from pydantic import BaseModel

from service.api.middleware.dependencies import BodyDep
from service.api.schemas import IntrinsicsOut, PictureSide, PoseOut, Text
from service.cameras.calibrations import ReadCalibration, read_camera
from service.wording.calibrations import notes_of


class CalibrationOut(BaseModel):
    """A calibration; `intrinsics` and `prior_pose` are null if the file has none."""

    format: str
    camera: str | None
    intrinsics: IntrinsicsOut | None
    prior_pose: PoseOut | None
    notes: list[str]

    @classmethod
    def from_value(cls, value: ReadCalibration) -> Self:
        """The body of a calibration."""
        lens, pose = value.lens, value.pose
        return cls(
            format=value.file.format,
            camera=value.file.camera,
            intrinsics=None if lens is None else IntrinsicsOut.model_validate(asdict(lens)),
            prior_pose=None if pose is None else PoseOut.from_value(pose),
            notes=notes_of(value.file),
        )


router = APIRouter(prefix="/calibrations", tags=["cameras"])

# Any type is taken: the reader recognises the format by the content.
_FILE = {"schema": {"type": "object", "description": "or YAML, XML, text, ZIP, .npz"}}
_BODY: dict[str, Any] = {"requestBody": {"required": True, "content": {"application/json": _FILE}}}


@router.post("", openapi_extra=_BODY)
def read_calibration(
    body: BodyDep,
    camera: Annotated[Text, Query(description="its name in a file of several")] = "",
    width: Annotated[PictureSide | None, Query(description="if the file has no size")] = None,
    height: Annotated[PictureSide | None, Query(description="if the file has no size")] = None,
) -> CalibrationOut:
    """Read a calibration file.

    The formats are OpenCV, ROS, Kalibr, MATLAB, COLMAP, NVIDIA, KRTD and Tsai. `intrinsics` and
    `prior_pose` of the answer fit `POST /cameras`; nothing is stored. `notes` lists contents of the
    file that are not used, such as the rotation between two cameras.
    """
    size = None if width is None or height is None else (width, height)
    return CalibrationOut.from_value(read_camera(body, camera or None, size))
