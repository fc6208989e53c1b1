"""The log of what was done: it only grows, and outlives what it tells of."""

from datetime import datetime
from typing import Any

from sqlalchemy import Index, String
from sqlalchemy.orm import Mapped, mapped_column

from service.enums import Activity, AlertKind, Outcome
from service.store.tables.record import Record, one_of


class ActivityRecord(Record):
    """What somebody, or the service where `by` is None, did.

    `camera_id` refers to
    nothing, so that it stays when the camera goes; `subject_id` is the alert's, training's or
    window's, `via` the token's. `kind` and `outcome` are an alert's, `until` of a silence or of
    maintenance; `note` has the words that were given. Triggers refuse changes, and deletions of
    what is younger than 30 days.
    """

    __tablename__ = "activity"

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime]
    what: Mapped[Activity]
    by: Mapped[str | None]
    via: Mapped[str | None]
    camera_id: Mapped[str | None] = mapped_column(String(64))
    subject_id: Mapped[str | None] = mapped_column(String(64))
    kind: Mapped[AlertKind | None]
    until: Mapped[datetime | None]
    outcome: Mapped[Outcome | None]
    note: Mapped[str | None]
    details: Mapped[dict[str, Any]]

    __table_args__ = (
        one_of("what", Activity),
        one_of("kind", AlertKind),
        one_of("outcome", Outcome),
        Index(None, "camera_id", "id"),
        Index(None, "subject_id", "id"),
        Index(None, "at"),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )
