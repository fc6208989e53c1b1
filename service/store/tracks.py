"""Stored tracks, and statements on them.

Of a camera's tracks those count that its reference is of: one source's. Others are stored, and
counted where a function says that it is of all.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
from sqlalchemy import (
    BindParameter,
    ColumnElement,
    Connection,
    Index,
    LargeBinary,
    Result,
    SQLColumnExpression,
    String,
    UniqueConstraint,
    bindparam,
    case,
    exists,
    func,
    select,
    update,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, Session, aliased, mapped_column

from models.durations import DAY_S
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.geometry.upright import tops_of_boxes, uncut
from models.tracks.scaling import Scaling
from models.tracks.trajectory import Trajectory
from service.store.cameras import CameraRecord
from service.store.engines.dialects import new_rows
from service.store.engines.sqlite import Prepared
from service.store.record import Record, camera_key, count_where, delete_some
from service.store.references import CameraId, counting_source
from service.store.run_budget import RunBudget, TrackSize


class TrackRecord(Record):
    """A stored track: points (N, 3), boxes (N, 4) and heads (N, 2) as little-endian float64.

    `first_px` is the number of the first pixel in its post; None if the post stated an image size.
    """

    __tablename__ = "tracks"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    source: Mapped[str]
    track_id: Mapped[str]
    started_s: Mapped[float]
    ended_s: Mapped[float]
    points: Mapped[bytes] = mapped_column(LargeBinary)
    boxes: Mapped[bytes | None] = mapped_column(LargeBinary)
    heads: Mapped[bytes | None] = mapped_column(LargeBinary)
    received_at: Mapped[datetime]
    first_px: Mapped[int | None]

    __table_args__ = (
        UniqueConstraint("camera_id", "source", "track_id", "started_s"),
        Index(None, "camera_id", "ended_s", "source"),
        Index(None, "camera_id", "id"),
        # What counts is counted without its points; when it came is the camera's rhythm.
        Index(None, "camera_id", "received_at", "ended_s", "source"),
    )


class StoredTrack(NamedTuple):
    """The columns of a `TrackRecord` that estimates need."""

    id: int
    track_id: str
    started_s: float
    ended_s: float
    points: bytes
    boxes: bytes | None
    heads: bytes | None
    received_at: datetime
    first_px: int | None


_COLUMNS = [getattr(TrackRecord, name) for name in StoredTrack._fields]
_LAST_BYTES = {"points": 24, "boxes": 32, "heads": 16}


def by_end(
    session: Session,
    *conditions: ColumnElement[bool],
    newest_first: bool = False,
    limit: int | None = None,
    budget: RunBudget | None = None,
) -> Sequence[StoredTrack]:
    """Tracks that meet some conditions in the order of their ends; or the newest first.

    Of tracks beyond a `budget` the last point alone is read: they count, and tell nothing.
    """
    order = [TrackRecord.ended_s.desc(), TrackRecord.id.desc()]
    ordered = order if newest_first else (TrackRecord.ended_s, TrackRecord.id)

    def rows(columns: Sequence[SQLColumnExpression[Any]]) -> Result[Any]:
        query = select(*columns).where(*conditions).order_by(*ordered)
        return session.execute(query.limit(limit))

    columns: Sequence[SQLColumnExpression[Any]] = _COLUMNS
    if budget is not None:
        skipped = budget.leave_out([TrackSize._make(row) for row in rows(SIZE_COLUMNS)])
        if skipped:
            columns = [_only_last(column, skipped) for column in _COLUMNS]
    return [StoredTrack._make(row) for row in rows(columns)]


_SOME = (
    select(*_COLUMNS)
    .where(TrackRecord.id.in_(bindparam("keys", expanding=True)))
    .order_by(TrackRecord.ended_s, TrackRecord.id)
)


def some(session: Session, track_pks: Sequence[int]) -> Sequence[StoredTrack]:
    """Some tracks, by their keys, in the order of their ends."""
    return [StoredTrack._make(row) for row in session.execute(_SOME, {"keys": track_pks})]


def _only_last(
    column: InstrumentedAttribute[Any], track_pks: Sequence[int]
) -> SQLColumnExpression[Any]:
    """A column of tracks; of some of them the last point, box or head alone."""
    size = _LAST_BYTES.get(column.key)
    if size is None:
        return column
    last = func.substr(column, func.length(column) - size + 1)
    return case((TrackRecord.id.in_(track_pks), last), else_=column)


def pack(array: Array) -> bytes:
    """Little-endian float64, row by row."""
    return np.ascontiguousarray(array, dtype="<f8").tobytes()


def unpack(data: bytes, columns: int) -> Array:
    """The array (N, columns) of `pack`."""
    return np.frombuffer(data, dtype="<f8").reshape(-1, columns).astype(np.float64)


def trajectory_of(record: StoredTrack) -> Trajectory:
    """The foot points of a stored track."""
    points = unpack(record.points, 3)
    return Trajectory(time_s=points[:, 0], uv=points[:, 1:])


def seen_of(record: StoredTrack, feet: Trajectory, intrinsics: Intrinsics) -> Trajectory:
    """The feet of a stored track with the upper edges of its boxes or its heads, where it has any.

    Who has a head is as tall as it is high, where the picture's border does not cut it.
    """
    if record.heads is not None:
        heads = unpack(record.heads, 2)
        tops = np.where(uncut(intrinsics, heads), heads[:, 1], np.nan)
        return replace(feet, top_v=tops, head_uv=heads)
    if record.boxes is None:
        return feet
    return replace(feet, top_v=tops_of_boxes(intrinsics, unpack(record.boxes, 4)))


Spans = tuple[tuple[float, float], ...]  # times, from and to


def bytes_of_track() -> ColumnElement[int]:
    """The bytes of a track's points, boxes and heads."""
    return (
        func.length(TrackRecord.points)
        + func.coalesce(func.length(TrackRecord.boxes), 0)
        + func.coalesce(func.length(TrackRecord.heads), 0)
    )


SIZE_COLUMNS = [
    TrackRecord.id,
    TrackRecord.track_id,
    TrackRecord.ended_s - TrackRecord.started_s,
    func.length(TrackRecord.points) // _LAST_BYTES["points"],
    bytes_of_track(),
]


def of_counting_source(camera_id: CameraId) -> ColumnElement[bool]:
    """The condition that a track is of the source that counts; all are, as long as none does."""
    counting = counting_source(camera_id).scalar_subquery()
    return TrackRecord.source == func.coalesce(counting, TrackRecord.source)


def counting(camera_id: str | BindParameter[str]) -> list[ColumnElement[bool]]:
    """The conditions that a track is of a camera, and of the source that counts."""
    return [TrackRecord.camera_id == camera_id, of_counting_source(camera_id)]


def started_from(camera_id: str, started_from_s: float | None) -> list[ColumnElement[bool]]:
    """The conditions that a track counts and started at or after a time."""
    conditions = counting(camera_id)
    if started_from_s is not None:
        conditions.append(TrackRecord.started_s >= started_from_s)
    return conditions


def outside(spans: Spans) -> list[ColumnElement[bool]]:
    """The conditions that tracks were seen at none of some times."""
    return [
        (TrackRecord.ended_s < from_s) | (TrackRecord.started_s > to_s) for from_s, to_s in spans
    ]


_ADDED = Prepared(
    new_rows(TrackRecord.__table__),
    [column for column in TrackRecord.__table__.columns.keys() if column != "id"],  # noqa: SIM118
)
# Built once: each reconcile of a camera asks for them.
_NEWEST_END = select(func.max(TrackRecord.ended_s)).where(
    *counting(bindparam("camera", type_=String))
)
_NEWEST_PK = select(func.max(TrackRecord.id)).where(TrackRecord.camera_id == bindparam("camera"))
_RECENT_S, _YEAR_S = 28 * DAY_S, 365.25 * DAY_S


def add(connection: Connection, rows: Sequence[dict[str, Any]]) -> int:
    """Insert tracks; one that is already stored stays as it is. Returns how many are new."""
    return _ADDED.change(connection, *rows) if rows else 0


def counts(session: Session, camera_ids: Collection[str]) -> dict[str, int]:
    """The number of stored tracks of each of some cameras that has any."""
    query = select(TrackRecord.camera_id, func.count())
    query = query.where(TrackRecord.camera_id.in_(camera_ids)).group_by(TrackRecord.camera_id)
    return {camera_id: number for camera_id, number in session.execute(query)}


def stored_bytes(session: Session, camera_id: str) -> tuple[str | None, dict[bool, int]]:
    """The source that counts, and the bytes of points, boxes and heads of a camera's tracks.

    Those of that source (True; of all, as long as none counts), and of all others together.
    """
    counts = of_counting_source(camera_id)
    sizes = select(counts, func.sum(bytes_of_track())).where(TrackRecord.camera_id == camera_id)
    rows = session.execute(sizes.group_by(counts))
    stored = {bool(of_it): int(size) for of_it, size in rows}
    return session.scalar(counting_source(camera_id)), stored


def newest_end_s(session: Session, camera_id: str) -> float | None:
    """The end of the newest track."""
    return session.scalar(_NEWEST_END, {"camera": camera_id})


def newest_received_at(session: Session, camera_id: str) -> datetime | None:
    """The time at which a track was stored last."""
    return session.scalar(select(func.max(TrackRecord.received_at)).where(*counting(camera_id)))


def arrivals(
    session: Session, camera_id: str, received_after: datetime
) -> Sequence[tuple[datetime, float]]:
    """The times at which tracks were stored and ended, of those stored after a time."""
    rows = session.execute(
        select(TrackRecord.received_at, TrackRecord.ended_s).where(
            *counting(camera_id), TrackRecord.received_at > received_after
        )
    )
    return [(received_at, ended_s) for received_at, ended_s in rows]


def newest_arrivals(
    session: Session, camera_id: str, limit: int
) -> Sequence[tuple[datetime, float]]:
    """The times at which the newest so many tracks to come were stored and ended, newest first."""
    rows = session.execute(
        select(TrackRecord.received_at, TrackRecord.ended_s)
        .where(*counting(camera_id))
        .order_by(TrackRecord.received_at.desc())
        .limit(limit)
    )
    return [(received_at, ended_s) for received_at, ended_s in rows]


def arrived_since(session: Session, camera_id: str, at: datetime) -> tuple[int, datetime | None]:
    """The number of tracks stored from a time on, and when the first of them was."""
    count, first_at = session.execute(
        select(func.count(), func.min(TrackRecord.received_at)).where(
            *counting(camera_id), TrackRecord.received_at >= at
        )
    ).one()
    return count, first_at


def count_ended(session: Session, camera_id: str, from_s: float, to_s: float) -> int:
    """The number of tracks that ended from one time to another."""
    ended_s = TrackRecord.ended_s
    return count_where(session, *counting(camera_id), ended_s >= from_s, ended_s <= to_s)


def count_since(session: Session, camera_id: str, ended_after_s: float | None) -> int:
    """The number of tracks that ended after a time; all of them, if none is given."""
    after = [] if ended_after_s is None else [TrackRecord.ended_s > ended_after_s]
    return count_where(session, *counting(camera_id), *after)


def newest_pk(session: Session, camera_id: str) -> int | None:
    """The track that was stored last."""
    return session.scalar(_NEWEST_PK, {"camera": camera_id})


def count_between(session: Session, camera_id: str, from_s: float, to_s: float) -> int:
    """The number of tracks that started after one time and before another."""
    started_s = TrackRecord.started_s
    return count_where(session, *counting(camera_id), started_s > from_s, started_s < to_s)


def a_year(session: Session, camera_id: str) -> float:
    """The number of tracks a year, by those of the newest four weeks; of a day at the least."""
    newest = newest_end_s(session, camera_id) or 0.0
    count, first = session.execute(
        select(func.count(), func.min(TrackRecord.ended_s)).where(
            *counting(camera_id), TrackRecord.ended_s >= newest - _RECENT_S
        )
    ).one()
    span_s = max(newest - (first or newest), DAY_S)
    return max(float(count), 1.0) * _YEAR_S / span_s


def newest(
    session: Session,
    camera_id: str,
    limit: int,
    started_from_s: float | None = None,
    ended_to_s: float | None = None,
) -> Sequence[StoredTrack]:
    """The newest tracks, newest first; of those from a time on and up to one, if they are given."""
    conditions = started_from(camera_id, started_from_s)
    if ended_to_s is not None:
        conditions.append(TrackRecord.ended_s <= ended_to_s)
    return by_end(session, *conditions, newest_first=True, limit=limit)


def forget(session: Session, camera_id: str, before: datetime, keep: int, limit: int) -> int:
    """Delete up to `limit` tracks that came before a time, or after which so many came; how many.

    By their arrival, not by their own times: what was recorded years ago and is posted today has
    been acknowledged today, and stays as long as what was walked today. The source that counts has
    a number of its own: no other can post its tracks away.
    """
    number = func.row_number().over(
        partition_by=of_counting_source(camera_id), order_by=TrackRecord.id.desc()
    )
    of_camera = TrackRecord.camera_id == camera_id
    numbered = select(TrackRecord.id, number.label("number")).where(of_camera).subquery()
    surplus = select(numbered.c.id).where(numbered.c.number > keep)
    outlived = (TrackRecord.received_at < before) | TrackRecord.id.in_(surplus)
    bite = select(TrackRecord.id).where(of_camera, outlived).order_by(TrackRecord.id).limit(limit)
    return delete_some(session, TrackRecord.id, bite)


_BITE = 500  # tracks that are unpacked at once


def rescale(session: Session, camera_id: str, source: str, old: Scaling, new: Scaling) -> int:
    """Map the stored tracks of a source to the frame by another scaling; return their number.

    Tracks that were posted with an image size keep their pixels. `old` is the scaling by which the
    others were stored.
    """
    packed = TrackRecord.points, TrackRecord.boxes, TrackRecord.heads
    query = (
        select(TrackRecord.id, TrackRecord.first_px, *packed)
        .where(
            TrackRecord.camera_id == camera_id,
            TrackRecord.source == source,
            TrackRecord.first_px.is_not(None),
        )
        .order_by(TrackRecord.id)
        .limit(_BITE)
    )

    def mapped(data: bytes | None, columns: int, apart: int, first: int = 0) -> bytes | None:
        if data is None:
            return None
        array = unpack(data, columns)
        array[:, first:] = new.applied(old.inverted(array[:, first:]) + apart)
        return pack(array)

    count, last = 0, -1
    while rows := session.execute(query.where(TrackRecord.id > last)).all():
        changed = []
        for pk, first_px, points, boxes, heads in rows:
            # Shares count from 0, also in a text that counts pixels from 1.
            apart = (first_px or 0) * (int(new.normalised) - int(old.normalised))
            rescaled = {
                "points": mapped(points, 3, apart, first=1),
                "boxes": mapped(boxes, 4, apart),
                "heads": mapped(heads, 2, apart),
            }
            changed.append({"id": pk} | rescaled)
        session.execute(update(TrackRecord), changed)
        count, last = count + len(rows), rows[-1].id
    return count


def existing(session: Session, track_pks: Sequence[int]) -> set[int]:
    """Those of the given tracks that are still stored."""
    return set(session.scalars(select(TrackRecord.id).where(TrackRecord.id.in_(track_pks))))


def forget_tracks(session: Session, camera_id: str, most_bytes: int, limit: int) -> int:
    """Delete up to `limit` tracks of a camera, the first that came, beyond so many bytes; how many.

    Bytes are those of points, boxes and heads, as `stored_bytes` counts them; the source
    that counts has as many as all others together.
    """
    size = bytes_of_track()
    together = (
        func.sum(size)
        .over(partition_by=of_counting_source(camera_id), order_by=TrackRecord.id.desc())
        .label("together")
    )
    sized = select(TrackRecord.id, together).where(TrackRecord.camera_id == camera_id).subquery()
    surplus = (
        select(sized.c.id).where(sized.c.together > most_bytes).order_by(sized.c.id).limit(limit)
    )
    return delete_some(session, TrackRecord.id, surplus)


def unseen_since(session: Session) -> dict[str, tuple[int, datetime]]:
    """The oldest track of each camera that no estimate job has looked at, and when it came."""
    first = (
        select(func.min(TrackRecord.id))
        .where(
            TrackRecord.camera_id == CameraRecord.id,
            TrackRecord.id > func.coalesce(CameraRecord.read_track_pk, -1),
        )
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    rows = session.execute(
        select(CameraRecord.id, TrackRecord.id, TrackRecord.received_at).join(
            TrackRecord, TrackRecord.id == first
        )
    )
    return {camera_id: (pk, received_at) for camera_id, pk, received_at in rows}


_OTHER = aliased(TrackRecord)
_MOVED = (
    update(TrackRecord.__table__)  # type: ignore[arg-type]
    .where(
        TrackRecord.id == bindparam("pk"),
        ~exists().where(
            _OTHER.camera_id == TrackRecord.camera_id,
            _OTHER.source == TrackRecord.source,
            _OTHER.track_id == TrackRecord.track_id,
            _OTHER.started_s == bindparam("new_started_s"),
        ),
    )
    .values(
        points=bindparam("new_points"),
        started_s=bindparam("new_started_s"),
        ended_s=bindparam("new_ended_s"),
    )
)
_MOVED_AT_ONCE = 500


def follow_clock(session: Session, back_s: int, limit_s: float) -> int:
    """Move the times of tracks that end after `limit_s` back; return how many there were.

    A track is deleted if another track of its name has its new start time already.
    """
    ahead = TrackRecord.camera_id.in_(select(CameraRecord.id)), TrackRecord.ended_s > limit_s
    found = session.scalars(select(TrackRecord.id).where(*ahead)).all()
    for at in range(0, len(found), _MOVED_AT_ONCE):
        chosen = TrackRecord.id.in_(found[at : at + _MOVED_AT_ONCE])
        rows = session.execute(select(TrackRecord.id, TrackRecord.points).where(chosen))
        session.connection().execute(_MOVED, [_moved(pk, data, back_s) for pk, data in rows])
    delete_some(session, TrackRecord.id, select(TrackRecord.id).where(*ahead))
    return len(found)


def _moved(track_pk: int, data: bytes, back_s: int) -> dict[str, Any]:
    points = unpack(data, 3)
    points[:, 0] -= back_s
    return {
        "pk": track_pk,
        "new_points": pack(points),
        "new_started_s": float(points[0, 0]),
        "new_ended_s": float(points[-1, 0]),
    }
