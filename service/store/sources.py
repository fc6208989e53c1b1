"""The sources of a camera's tracks."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import (
    Connection,
    ForeignKey,
    Integer,
    String,
    bindparam,
    delete,
    func,
    or_,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.engines.sqlite import Prepared
from service.store.record import Record, count_where
from service.store.tracks import Spans, TrackRecord, outside


class SourceRecord(Record):
    """A name that tracks of a camera came under. Which one counts is the reference's to say.

    `tracks` is how many have been stored, `told_at` when an alert told of it as new, `token_id` the
    token whose name it is; None where access was off.
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
    token_id: Mapped[str | None] = mapped_column(String(16))


_TOKEN = bindparam("token", type_=String)
_SEEN = Prepared(
    update(SourceRecord.__table__)  # type: ignore[arg-type]
    .where(
        SourceRecord.camera_id == bindparam("camera"),
        SourceRecord.name == bindparam("posted"),
        or_(
            SourceRecord.token_id.is_(None),
            SourceRecord.token_id == _TOKEN,
            bindparam("shared", type_=Integer) == 1,
        ),
    )
    .values(
        tracks=SourceRecord.tracks + bindparam("stored"),
        last_seen_at=bindparam("now"),
        token_id=func.coalesce(_TOKEN, SourceRecord.token_id),
    )
)

# Built once: each reconcile of a camera asks for it.
_OF_CAMERA = (
    select(SourceRecord)
    .where(SourceRecord.camera_id == bindparam("camera"))
    .order_by(SourceRecord.first_seen_at, SourceRecord.name)
)


def note_seen(
    connection: Connection,
    camera_id: str,
    name: str,
    stored: int,
    now: datetime,
    token_id: str | None,
    *,
    shared: bool,
) -> bool:
    """Count what a source has posted, if it is known, and the token's or `shared` with it."""
    said = {"camera": camera_id, "posted": name, "stored": stored, "now": now}
    return bool(_SEEN.change(connection, said | {"token": token_id, "shared": int(shared)}))


def find(session: Session, camera_id: str, name: str) -> SourceRecord | None:
    """A source of a camera, or None."""
    return session.get(SourceRecord, (camera_id, name))


def of_camera(session: Session, camera_id: str) -> Sequence[SourceRecord]:
    """The sources of a camera, the first to post first."""
    return session.scalars(_OF_CAMERA, {"camera": camera_id}).all()


def newest_end_s(session: Session, camera_id: str, name: str) -> float | None:
    """The end of the newest track of a source."""
    return session.scalar(
        select(func.max(TrackRecord.ended_s)).where(
            TrackRecord.camera_id == camera_id, TrackRecord.source == name
        )
    )


def count_from(
    session: Session, camera_id: str, name: str, started_from_s: float | None, without: Spans
) -> int:
    """The number of tracks of a source that started from a time on and were not seen at others."""
    conditions = [TrackRecord.camera_id == camera_id, TrackRecord.source == name, *outside(without)]
    if started_from_s is not None:
        conditions.append(TrackRecord.started_s >= started_from_s)
    return count_where(session, *conditions)


def forget(session: Session, record: SourceRecord) -> None:
    """Delete a source with its tracks."""
    session.execute(
        delete(TrackRecord).where(
            TrackRecord.camera_id == record.camera_id, TrackRecord.source == record.name
        )
    )
    session.delete(record)
