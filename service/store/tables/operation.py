"""Records of the service itself: events, workers, and the probe of its store."""

from datetime import datetime
from typing import Any

from sqlalchemy.orm import Mapped, mapped_column

from service.enums import (
    EventType,
)
from service.store.tables.record import Record, one_of


class EventRecord(Record):
    """Something that happened, for `GET /events`."""

    __tablename__ = "events"

    id: Mapped[int] = mapped_column(primary_key=True)
    type: Mapped[EventType]
    payload: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = (
        one_of("type", EventType),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )


class ProbeRecord(Record):
    """One row, written anew to see whether the store can be written."""

    __tablename__ = "store_probes"

    id: Mapped[int] = mapped_column(primary_key=True)
    written_at: Mapped[datetime]


class WorkerRecord(Record):
    """A worker process and when it was last heard of.

    `beats` grows with each sign of life: others tell by it, and by no clock, whether it lives.
    `starts` counts its processes. `lost` says that its jobs were given to others. `trouble` is what
    `serve` has to say of one that it cannot keep alive.
    """

    __tablename__ = "workers"

    name: Mapped[str] = mapped_column(primary_key=True)
    pid: Mapped[int]
    started_at: Mapped[datetime]
    heartbeat_at: Mapped[datetime]
    beats: Mapped[int] = mapped_column(default=0)
    starts: Mapped[int] = mapped_column(default=1)
    lost: Mapped[bool] = mapped_column(default=False)
    trouble: Mapped[str | None]
