"""Number and CPU time of estimation runs by kind, hour by hour."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import Index, func, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.enums import RunKind
from service.store.record import Record, delete_some


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTotal:
    """A number of estimation runs and the CPU seconds that they took."""

    runs: int = 0
    cpu_s: float = 0.0

    def __add__(self, other: "RunTotal") -> "RunTotal":
        return RunTotal(runs=self.runs + other.runs, cpu_s=self.cpu_s + other.cpu_s)

    def __sub__(self, other: "RunTotal") -> "RunTotal":
        return RunTotal(runs=self.runs - other.runs, cpu_s=self.cpu_s - other.cpu_s)


class RunHourRecord(Record):
    """All runs of a kind up to the end of an hour.

    The newest row of a kind has its total, so older rows can be deleted and the total never falls.
    """

    __tablename__ = "estimation_run_hours"

    id: Mapped[int] = mapped_column(primary_key=True)
    kind: Mapped[RunKind]
    hour_at: Mapped[datetime]
    runs: Mapped[int]
    cpu_s: Mapped[float]

    __table_args__ = (Index(None, "kind", "id"),)

    @property
    def total(self) -> RunTotal:
        """The runs up to the end of this hour."""
        return RunTotal(runs=self.runs, cpu_s=self.cpu_s)


def add(session: Session, found: Mapping[RunKind, RunTotal], now: datetime) -> None:
    """Add runs that workers have made to the current hour."""
    hour_at = now.replace(minute=0, second=0, microsecond=0)
    for kind, more in found.items():
        last = _newest(session, kind)
        if last is None or last.hour_at < hour_at:
            total = more if last is None else last.total + more
            last = RunHourRecord(kind=kind, hour_at=hour_at, runs=total.runs, cpu_s=total.cpu_s)
            session.add(last)
            session.flush()
        else:  # also if the clock was set back
            last.runs, last.cpu_s = last.runs + more.runs, last.cpu_s + more.cpu_s


def totals(session: Session) -> dict[RunKind, RunTotal]:
    """All runs by kind since the first one."""
    newest = {kind: _newest(session, kind) for kind in RunKind}
    return {kind: RunTotal() if row is None else row.total for kind, row in newest.items()}


def by_hour(session: Session, hours: int, now: datetime) -> dict[RunKind, list[RunTotal]]:
    """The runs of each of the last hours by kind, oldest first, up to the current hour."""
    current = now.replace(minute=0, second=0, microsecond=0)
    starts = [current - timedelta(hours=back) for back in range(hours - 1, -1, -1)]
    return {kind: _by_hour(session, kind, starts) for kind in RunKind}


def forget(session: Session, before: datetime, limit: int) -> int:
    """Delete hours before a time, except the newest of each kind; returns how many."""
    newest = select(func.max(RunHourRecord.id)).group_by(RunHourRecord.kind)
    old = select(RunHourRecord.id).where(
        RunHourRecord.hour_at < before, RunHourRecord.id.not_in(newest)
    )
    return delete_some(session, RunHourRecord.id, old.order_by(RunHourRecord.id).limit(limit))


def _newest(
    session: Session, kind: RunKind, before: datetime | None = None
) -> RunHourRecord | None:
    query = select(RunHourRecord).where(RunHourRecord.kind == kind)
    if before is not None:
        query = query.where(RunHourRecord.hour_at < before)
    return session.scalars(query.order_by(RunHourRecord.id.desc()).limit(1)).first()


def _by_hour(session: Session, kind: RunKind, starts: list[datetime]) -> list[RunTotal]:
    rows = session.scalars(
        select(RunHourRecord)
        .where(RunHourRecord.kind == kind, RunHourRecord.hour_at >= starts[0])
        .order_by(RunHourRecord.id)
    )
    at_end = {row.hour_at: row.total for row in rows}
    before = _newest(session, kind, starts[0])
    total, found = RunTotal() if before is None else before.total, []
    for start in starts:
        end = at_end.get(start, total)
        found.append(end - total)
        total = end
    return found
