"""Records of alerts."""

from datetime import datetime
from typing import Any

from sqlalchemy import JSON, Index, String, text
from sqlalchemy.orm import Mapped, mapped_column

from service.enums import (
    AlertKind,
    AlertSource,
    AlertState,
    Outcome,
    Severity,
)
from service.reasons import Reasons, code_of, values_of
from service.store.tables.base import camera_key, foreign_key
from service.store.tables.record import Record, one_of

_FIRING = f"state = '{AlertState.FIRING}'"


class AlertRecord(Record):
    """An alert; at most one of a camera and kind is firing.

    `source` tells whether an estimate fired it, which then ends it too, the reference, the camera's
    rhythm, the upkeep, or a group. A group's alert has no camera but `camera_ids`, and its members
    have its id as `group_id`; at most one of a `track_source` and kind is firing. `notified` says
    whether an event told of the alert by itself.
    """

    __tablename__ = "alerts"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str | None] = camera_key()
    camera_ids: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))
    group_id: Mapped[str | None] = foreign_key("alerts.id", "SET NULL", index=True)
    track_source: Mapped[str | None]
    kind: Mapped[AlertKind]
    state: Mapped[AlertState]
    source: Mapped[AlertSource]
    notified: Mapped[bool] = mapped_column("told", default=False)
    severity: Mapped[Severity]
    reasons: Mapped[Reasons]
    drift: Mapped[dict[str, Any]]
    opened_at: Mapped[datetime]
    changed_at: Mapped[datetime | None]
    updated_at: Mapped[datetime]
    acknowledged_by: Mapped[str | None]
    acknowledged_at: Mapped[datetime | None]
    silenced_until: Mapped[datetime | None]
    silence_reason: Mapped[str | None]
    silenced_by: Mapped[str | None]
    resolved_at: Mapped[datetime | None]
    resolved_by: Mapped[str | None]
    outcome: Mapped[Outcome | None]
    note: Mapped[str | None]

    __table_args__ = (
        one_of("kind", AlertKind),
        one_of("state", AlertState),
        one_of("source", AlertSource),
        one_of("severity", Severity),
        one_of("outcome", Outcome),
        Index(
            "uq_alerts_firing",
            "camera_id",
            "kind",
            unique=True,
            sqlite_where=text(_FIRING),
            postgresql_where=text(_FIRING),
        ),
        Index(
            "uq_alerts_firing_group",
            "track_source",
            "kind",
            unique=True,
            sqlite_where=text(f"{_FIRING} AND camera_id IS NULL"),
            postgresql_where=text(f"{_FIRING} AND camera_id IS NULL"),
        ),
        Index(None, "opened_at"),
        Index(None, "camera_id", "opened_at"),
    )

    @property
    def reason_code(self) -> str | None:
        """The code of the first reason; None of a group that is about to be told."""
        return code_of(self.reasons)

    @property
    def reason_values(self) -> dict[str, Any]:
        """The numbers and names of the first reason, angles in degrees."""
        return values_of(self.reasons)

    def is_silenced(self, now: datetime) -> bool:
        """Whether it is to be quiet."""
        return self.silenced_until is not None and self.silenced_until > now
