"""Bridges between an MQTT broker and the service, by their heartbeats."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import JSON, String, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record


class BridgeRecord(Record):
    """A bridge and its newest heartbeat, by the database's clock.

    `starts` counts its processes, and `recent_starts` has the last few as seconds since the epoch.
    `stopped` says that it ended on purpose, `report` has its counts. `trouble` is why `serve`
    cannot keep it running. `token_id` is the token that it reports with; None where access is off.
    """

    __tablename__ = "bridges"

    name: Mapped[str] = mapped_column(String(63), primary_key=True)
    token_id: Mapped[str | None] = mapped_column(String(16))
    started_at: Mapped[datetime]
    heartbeat_at: Mapped[datetime]
    starts: Mapped[int]
    recent_starts: Mapped[list[float]] = mapped_column(JSON)
    stopped: Mapped[bool]
    report: Mapped[dict[str, Any]] = mapped_column(JSON)
    trouble: Mapped[str | None]


def every(session: Session) -> Sequence[BridgeRecord]:
    """All bridges that ever reported, or that `serve` could not start."""
    return session.scalars(select(BridgeRecord).order_by(BridgeRecord.name)).all()


def forget(session: Session, before: datetime) -> None:
    """Delete bridges that stopped on purpose before a time."""
    session.execute(
        delete(BridgeRecord).where(BridgeRecord.stopped, BridgeRecord.heartbeat_at < before)
    )
