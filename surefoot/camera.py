"""A camera: its lens and its prior pose, as its calibration has them."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any, Self

from models.errors import ShapeError
from models.geometry.intrinsics import Intrinsics
from models.geometry.lens_checks import check_lens
from models.geometry.lens_forms import lens_of
from models.geometry.pose import CameraPose

_PRIOR = ("prior_pose", "true_pose")  # a registration's, and a recorded scene's


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A pose in metres and degrees; x and y are of the camera's centre in the world."""

    height_m: float
    tilt_deg: float
    roll_deg: float = 0.0
    heading_deg: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0

    @classmethod
    def of(cls, pose: CameraPose) -> Self:
        """The same pose, its angles in degrees."""
        return cls(
            height_m=pose.height_m,
            tilt_deg=math.degrees(pose.tilt_rad),
            roll_deg=math.degrees(pose.roll_rad),
            heading_deg=math.degrees(pose.heading_rad),
            x_m=pose.x_m,
            y_m=pose.y_m,
        )

    @property
    def in_radians(self) -> CameraPose:
        """The same pose, its angles in radians.

        Raises:
            ShapeError: a number is not finite, the height is not above 0, the tilt beyond +-90 deg.
        """
        return CameraPose.of_degrees(**asdict(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A lens, in pixels, and the pose at which the camera is known to have stood."""

    intrinsics: Intrinsics
    prior_pose: Pose

    def as_json(self) -> str:
        """JSON of the camera, for `read_camera`."""
        return json.dumps(asdict(self), indent=1)


def is_registration(document: Any) -> bool:
    """True of an object with our names of a lens or of a prior pose."""
    return isinstance(document, dict) and any(
        isinstance(document.get(name), dict) for name in ("intrinsics", "lens", *_PRIOR)
    )


def camera_of(body: dict[str, Any]) -> Camera:
    """The camera of a registration's body.

    Raises:
        ShapeError: a number is missing, or is none that a camera can have.
    """
    if not isinstance(body, dict):
        raise ShapeError(f"an object is needed, got {type(body).__name__}")
    prior = next((body[name] for name in _PRIOR if name in body), None)
    if prior is None:
        raise ShapeError("prior_pose: height_m and tilt_deg are needed, got none")
    if ("lens" in body) == ("intrinsics" in body):
        raise ShapeError("intrinsics, lens: one of both is needed")
    try:
        lens = lens_of(**body["lens"]) if "lens" in body else Intrinsics(**body["intrinsics"])
        check_lens(lens)
        camera = Camera(intrinsics=lens, prior_pose=Pose(**prior))
        _ = camera.prior_pose.in_radians  # refuses what no camera can have
    except (KeyError, TypeError, AttributeError, ZeroDivisionError) as error:
        raise ShapeError(f"intrinsics or lens, prior_pose: {error}") from error
    return camera
