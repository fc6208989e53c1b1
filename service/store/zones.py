"""Zones of cameras, with the lens and the pose at which they were drawn."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey
from sqlalchemy.orm import Mapped, Session, mapped_column

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


def of_camera(session: Session, camera_id: str) -> ZonesRecord | None:
    """The zones of a camera; None where none were ever drawn."""
    return session.get(ZonesRecord, camera_id)
