"""Records of cameras, their prior poses and still images."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, LargeBinary, String, false
from sqlalchemy.orm import Mapped, mapped_column

from service.enums import (
    Origin,
)
from service.reasons import Reasons
from service.store.tables.base import camera_key
from service.store.tables.record import Record, one_of


class CameraRecord(Record):
    """A registered camera. `estimate_due_at` is set while tracks wait to be looked at.

    `looked_at_pk` is the newest track that an estimate job has looked at, whatever came of it.
    `estimate_tries` counts the looks since the last one that came to its end. If they fail,
    `estimate_error` says why and `estimate_failing_since` since when. None is begun before
    `estimate_after`. `lacks` says what failed beside the served estimate. One that is `urgent` may
    have moved: it is looked at before others.
    """

    __tablename__ = "cameras"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str]
    width: Mapped[int]
    height: Mapped[int]
    fx: Mapped[float]
    fy: Mapped[float]
    cx: Mapped[float]
    cy: Mapped[float]
    distortion: Mapped[list[float]]
    frame_rate_hz: Mapped[float | None]
    walking_speed_mean_mps: Mapped[float]
    walking_speed_sd_mps: Mapped[float]
    reference_tracks: Mapped[int]
    version: Mapped[int]
    estimate_due_at: Mapped[datetime | None]
    looked_at_pk: Mapped[int | None]
    estimate_tries: Mapped[int] = mapped_column(default=0)
    estimate_error: Mapped[str | None]
    estimate_failing_since: Mapped[datetime | None]
    estimate_after: Mapped[datetime | None]
    lacks: Mapped[Reasons] = mapped_column(default=())
    urgent: Mapped[bool] = mapped_column(default=False, server_default=false())
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]


class PriorPoseRecord(Record):
    """A pose that was trusted from a time on; the newest of a camera is its prior pose."""

    __tablename__ = "prior_poses"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    heading_rad: Mapped[float]
    x_m: Mapped[float]
    y_m: Mapped[float]
    origin: Mapped[Origin]
    trusted_by: Mapped[str | None]
    created_at: Mapped[datetime]

    __table_args__ = (
        one_of("origin", (Origin.REGISTERED, Origin.CHANGED, Origin.ACCEPTED)),
        Index(None, "camera_id", "id"),
    )


class SnapshotRecord(Record):
    """A still image of a camera, a JPEG, in a row of its own: no other query reads it."""

    __tablename__ = "snapshots"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    jpeg: Mapped[bytes] = mapped_column(LargeBinary)
    sha256: Mapped[str] = mapped_column(String(64))
    width: Mapped[int]
    height: Mapped[int]
    stored_at: Mapped[datetime]
