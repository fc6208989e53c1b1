"""Records of worker processes."""

from datetime import datetime

from sqlalchemy.orm import Mapped, mapped_column

from service.store.record import Record


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
