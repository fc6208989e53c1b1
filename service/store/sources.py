"""Track sources of cameras, and the posters behind them."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import (
    Connection,
    ForeignKey,
    Integer,
    Select,
    String,
    bindparam,
    delete,
    func,
    or_,
    select,
    update,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, Session, mapped_column

from service.store import monitor_states
from service.store.cameras import CameraRecord
from service.store.engines.sqlite import Prepared
from service.store.record import Record, count_where
from service.store.references import counting_source
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Poster:
    """The tracker behind a camera: a source name, and the token that posts under it.

    `token_id` is empty if access control is off.
    """

    source: str
    token_id: str


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


def poster_of(session: Session, camera_id: str) -> Poster | None:
    """Return the poster of the active source; of the newest track's, if no source is active."""
    name = session.scalar(_feeding_source(camera_id))
    if name is None:
        return None
    record = find(session, camera_id, name)
    return Poster(source=name, token_id=(record and record.token_id) or "")


def cameras_fed_by(session: Session, poster: Poster, received_after: datetime) -> set[str]:
    """Return the cameras of a poster that received a track after a time."""
    received = (
        select(func.max(TrackRecord.received_at))
        .where(TrackRecord.camera_id == CameraRecord.id)
        .scalar_subquery()
    )
    token_id = (
        select(SourceRecord.token_id)
        .where(SourceRecord.camera_id == CameraRecord.id, SourceRecord.name == poster.source)
        .scalar_subquery()
    )
    return set(
        session.scalars(
            select(CameraRecord.id).where(
                _feeding_source(CameraRecord.id).scalar_subquery() == poster.source,
                func.coalesce(token_id, "") == poster.token_id,
                received > received_after,
            )
        )
    )


def _feeding_source(camera_id: str | InstrumentedAttribute[str]) -> Select[str]:
    newest = (
        select(TrackRecord.source)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(1)
    )
    if not isinstance(camera_id, str):
        newest = newest.correlate(camera_id.class_)
    return select(
        func.coalesce(counting_source(camera_id).scalar_subquery(), newest.scalar_subquery())
    )


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
    monitor_states.forget(session, record.camera_id)  # a new track may get the key of a deleted one
    session.delete(record)
