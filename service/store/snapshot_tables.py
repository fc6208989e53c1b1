"""The record of a camera's still image: the only picture that is kept."""

from datetime import datetime

from sqlalchemy import ForeignKey, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.record import Record


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
