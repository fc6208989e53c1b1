"""The sources of tracks that have posted for a camera."""

from datetime import datetime

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.record import Record


class SourceRecord(Record):
    """A name that tracks of a camera came under. Which one counts is the reference's to say.

    `tracks` is how many have been stored, `told_at` when an alert told of it as new.
    """

    __tablename__ = "track_sources"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    name: Mapped[str] = mapped_column(String(200), primary_key=True)
    tracks: Mapped[int]
    first_seen_at: Mapped[datetime]
    last_seen_at: Mapped[datetime]
    told_at: Mapped[datetime | None]
