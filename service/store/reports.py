"""The last weekly report, which is kept so that it is sent once."""

from datetime import datetime

from sqlalchemy import String, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record


class ReportRecord(Record):
    """The report that was due at a time, as it is mailed; `error` is the last refusal's."""

    __tablename__ = "reports"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    due_at: Mapped[datetime]
    made_at: Mapped[datetime]
    subject: Mapped[str]
    text: Mapped[str]
    mailed_at: Mapped[datetime | None]
    error: Mapped[str | None]


def newest(session: Session, now: datetime) -> ReportRecord | None:
    """The last report; none that was due after now, by a clock that has been set back."""
    query = select(ReportRecord).where(ReportRecord.due_at <= now)
    return session.scalars(query.order_by(ReportRecord.due_at.desc()).limit(1)).first()


def replace(session: Session, record: ReportRecord) -> None:
    """Keep a report instead of those before it, whether they were mailed or not."""
    session.execute(delete(ReportRecord))
    session.add(record)
