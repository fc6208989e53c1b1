"""Zones of cameras, with the lens and the pose at which they were drawn."""

from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import JSON, ForeignKey
from sqlalchemy.orm import Mapped, Session, mapped_column

from models.geometry.intrinsics import Intrinsics
from models.geometry.outlines import Outline, View
from models.geometry.pose import CameraPose
from service.enums import ZoneOn
from service.store.record import Record, foreign_key


class ZonesRecord(Record):
    """All zones of a camera, as they were drawn at a time.

    `document` is what came, if its `form` is not our own. `covariance` (4, 4) is that of the pose
    against the prior pose, None where it is the prior pose.
    """

    __tablename__ = "zones"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    zones: Mapped[list[Any]] = mapped_column(JSON)  # id, on, corners in pixels
    form: Mapped[str | None]
    document: Mapped[Any] = mapped_column(JSON(none_as_null=True), nullable=True)
    intrinsics: Mapped[dict[str, Any]]
    pose: Mapped[dict[str, Any]]
    covariance: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    version: Mapped[int]
    drawn_at: Mapped[datetime]
    updated_at: Mapped[datetime]

    @property
    def view(self) -> View:
        """The lens and the pose at which they were drawn."""
        return View(intrinsics=Intrinsics(**self.intrinsics), pose=CameraPose(**self.pose))

    @property
    def outlines(self) -> dict[str, Outline]:
        """The outlines of zones by their ids, in their order."""
        drawn = self.view
        return {
            each["id"]: Outline(
                corners=np.array(each["corners"], dtype=np.float64),
                drawn=drawn,
                on_ground=each["on"] == ZoneOn.GROUND,
            )
            for each in self.zones
        }


def of_camera(session: Session, camera_id: str) -> ZonesRecord | None:
    """The zones of a camera; None where none were ever drawn."""
    return session.get(ZonesRecord, camera_id)
