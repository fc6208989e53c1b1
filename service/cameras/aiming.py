"""Where to turn a camera so that it looks where it did, while somebody is on the ladder."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
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
    """What a camera is aimed by, where there are pictures: the features of its gallery."""

    intrinsics: Intrinsics
    gallery: tuple[bytes, ...]
    snapshot_url: str | None


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


def aim_target(session: Session, camera_id: str) -> AimTarget:
    """What a camera is aimed by.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: no prior pose has been confirmed.
    """
    camera = require_camera(session, camera_id)
    prior = cameras.prior_pose(session, camera_id)
    if prior.assumed:
        raise ConflictError("pose: no prior pose has been confirmed yet")
    return AimTarget(
        intrinsics=camera.intrinsics,
        gallery=tuple(each.features for each in pictures.gallery(session, prior.id)),
        snapshot_url=camera.snapshot_url,
    )


def aim_by_picture(target: AimTarget, still: Still) -> Aim | None:
    """The aim by a picture of now; None where it matches none of the gallery."""
    # 40 MB that a service without pictures never needs.
    from models.pictures import best_turn, describe_jpeg, read_gallery

    gallery = read_gallery(target.gallery)
    turn = best_turn(gallery, describe_jpeg(still.jpeg), target.intrinsics).turn
    return None if turn is None else _aim(turn.matrix, by_picture=True, at=datetime.now(UTC))


def aim_by_people(session: Session, settings: Settings, camera_id: str) -> Aim | None:
    """The aim by the newest people; None where they tell no pose."""
    view = view_pose(session, settings, camera_id)
    estimate, known = view.status.estimate, {"tilt", "roll"} <= set(view.status.identifiable)
    if estimate is None or not known:
        return None
    turned = view.pose.rotation @ cameras.prior_pose(session, camera_id).pose.rotation.T
    return _aim(turned, by_picture=False, at=from_seconds(estimate.to_s))


def _aim(matrix: Array, *, by_picture: bool, at: datetime) -> Aim:
    from models.pictures import aim_of

    right, down, clockwise = aim_of(matrix)
    return Aim(
        right_rad=-right,
        up_rad=down,
        clockwise_rad=-clockwise,
        by_picture=by_picture,
        at=at,
    )
