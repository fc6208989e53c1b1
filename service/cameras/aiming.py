"""Where to turn a camera so that it looks where it did, while somebody is on the ladder."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.errors import CheckpointError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.cameras.cameras import require_camera
from service.cameras.poses import view_pose
from service.errors import ConflictError
from service.formats.still import Still
from service.settings import Settings
from service.store import cameras, pictures
from service.wording.times import from_seconds

GOOD_RAD = math.radians(0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class AimTarget:
    """What a camera is aimed by: the features of its gallery, or what people told last.

    `people` is the rotation from the prior pose to the served one; None where they tell none.
    """

    intrinsics: Intrinsics
    gallery: tuple[bytes, ...]
    snapshot_url: str | None
    people: Any
    people_at: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """How far to turn a camera right, up and clockwise, in radians, to have it where it was.

    `by_picture`, or else by the newest people, who take minutes. Of a time.
    """

    right_rad: float
    up_rad: float
    clockwise_rad: float
    by_picture: bool
    at: datetime

    @property
    def good(self) -> bool:
        """True where nothing is left to turn."""
        return max(map(abs, (self.right_rad, self.up_rad, self.clockwise_rad))) <= GOOD_RAD


def aim_target(session: Session, settings: Settings, camera_id: str) -> AimTarget:
    """What a camera is aimed by.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: nobody has agreed to a prior pose.
    """
    camera = require_camera(session, camera_id)
    prior = cameras.prior_pose(session, camera_id)
    if prior.assumed:
        raise ConflictError("pose: nobody has agreed to a prior pose yet")
    view = view_pose(session, settings, camera_id)
    estimate, known = view.status.estimate, {"tilt", "roll"} <= set(view.status.identifiable)
    return AimTarget(
        intrinsics=camera.intrinsics,
        gallery=tuple(each.features for each in pictures.gallery(session, prior.id)),
        snapshot_url=camera.snapshot_url,
        people=_rotation(prior.pose, view.pose) if known else None,
        people_at=None if estimate is None else from_seconds(estimate.to_s),
    )


def _rotation(prior: CameraPose, served: CameraPose) -> Any:
    return served.rotation @ prior.rotation.T


def aim_by_picture(target: AimTarget, still: Still) -> Aim | None:
    """The aim by a picture of now; None where it matches none of the gallery."""
    # 40 MB that a service without pictures never needs.
    import cv2

    from models.pictures import Features, best_turn, describe

    try:
        gallery = [Features.from_bytes(each) for each in target.gallery]
    except CheckpointError:
        return None
    grey: Any = cv2.imdecode(np.frombuffer(still.jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    turn = best_turn(gallery, describe(grey), target.intrinsics).turn
    return None if turn is None else _aim(turn.matrix, by_picture=True, at=datetime.now(UTC))


def aim_by_people(target: AimTarget) -> Aim | None:
    """The aim by the newest people; None where they tell no pose."""
    if target.people is None or target.people_at is None:
        return None
    return _aim(target.people, by_picture=False, at=target.people_at)


def _aim(matrix: Any, *, by_picture: bool, at: datetime) -> Aim:
    from models.pictures import aim_of

    right, down, clockwise = aim_of(matrix)
    return Aim(
        right_rad=-right,
        up_rad=down,
        clockwise_rad=-clockwise,
        by_picture=by_picture,
        at=at,
    )
