"""Statements on tracks and predictions.

Of a camera's tracks those count that its reference is of: one source's. Others are stored, and
counted where a function says that it is of all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Select, and_, delete, func, select
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import InstrumentedAttribute, Session, aliased

from service.store.tables import (
    CameraRecord,
    PredictionRecord,
    SiteReferenceRecord,
    TrackRecord,
)

Spans = tuple[tuple[float, float], ...]  # times, from and to

_DAY_S, _RECENT_S, _YEAR_S = 86_400.0, 28 * 86_400.0, 365.25 * 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowBounds:
    """The newest so many tracks of a camera within so many days of its newest, by their own times.

    Only those count that started at or after `started_from_s`, ended after `ended_after_s` and at
    or after `ended_from_s`; None is no bound. Those do not that were seen at any time `without`.
    """

    camera_id: str
    tracks: int
    days: float
    started_from_s: float | None = None
    ended_after_s: float | None = None
    ended_from_s: float | None = None
    without: Spans = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class StillBounds:
    """Tracks of a camera at its prior pose: those of its reference period, and later ones.

    The period is of tracks that started at or after `started_from_s` and ended by
    `reference_to_s`. Of later ones, the newest `unsure` of all its tracks do not count, nor those
    that were seen at any time `without`. Of neither do those that were seen while somebody
    `attended` to the camera.
    """

    camera_id: str
    started_from_s: float | None
    reference_to_s: float
    unsure: int
    without: Spans
    attended: Spans = ()


def add(session: Session, rows: Sequence[dict[str, Any]]) -> int:
    """Insert tracks; one that is already stored stays as it is. Returns how many are new."""
    if not rows:
        return 0
    # One statement for all of them: others wait for the lock meanwhile.
    statement = insert(TrackRecord.__table__).on_conflict_do_nothing()  # type: ignore[arg-type]
    return session.connection().execute(statement, rows).rowcount


def count(session: Session, camera_id: str) -> int:
    """How many tracks are stored."""
    query = select(func.count()).select_from(TrackRecord)
    return session.scalar(query.where(TrackRecord.camera_id == camera_id)) or 0


def stored_bytes(session: Session, camera_id: str) -> int:
    """How many bytes the points and boxes of a camera's tracks have."""
    size = func.length(TrackRecord.points) + func.coalesce(func.length(TrackRecord.boxes), 0)
    return session.scalar(select(func.sum(size)).where(TrackRecord.camera_id == camera_id)) or 0


def newest_end_s(session: Session, camera_id: str) -> float | None:
    """When the newest track ended."""
    return session.scalar(select(func.max(TrackRecord.ended_s)).where(*_counting(camera_id)))


def newest_received_at(session: Session, camera_id: str) -> datetime | None:
    """When a track was stored last."""
    return session.scalar(
        select(func.max(TrackRecord.received_at)).where(TrackRecord.camera_id == camera_id)
    )


def arrivals(
    session: Session, camera_id: str, received_after: datetime
) -> Sequence[tuple[datetime, float]]:
    """When tracks were stored and when they had ended, of those stored after a time."""
    rows = session.execute(
        select(TrackRecord.received_at, TrackRecord.ended_s).where(
            *_counting(camera_id), TrackRecord.received_at > received_after
        )
    )
    return [(received_at, ended_s) for received_at, ended_s in rows]


def count_ended(session: Session, camera_id: str, from_s: float, to_s: float) -> int:
    """How many tracks ended from one time to another."""
    query = select(func.count()).where(
        *_counting(camera_id),
        TrackRecord.ended_s >= from_s,
        TrackRecord.ended_s <= to_s,
    )
    return session.scalar(query) or 0


def newest_source(session: Session, camera_id: str) -> str | None:
    """The source that counts; where none does yet, that of the newest track."""
    return session.scalar(_newest_source(camera_id))


def cameras_fed_by(session: Session, source: str, received_after: datetime) -> set[str]:
    """The cameras for which a source counts, of those that got a track after a time."""
    received = (
        select(func.max(TrackRecord.received_at))
        .where(TrackRecord.camera_id == CameraRecord.id)
        .scalar_subquery()
    )
    return set(
        session.scalars(
            select(CameraRecord.id).where(
                _newest_source(CameraRecord.id).scalar_subquery() == source,
                received > received_after,
            )
        )
    )


def newest_pk(session: Session, camera_id: str) -> int | None:
    """The track that was stored last."""
    return session.scalar(
        select(func.max(TrackRecord.id)).where(TrackRecord.camera_id == camera_id)
    )


def window(session: Session, bounds: WindowBounds) -> Sequence[TrackRecord]:
    """The tracks of a window in the order of their ends."""
    return session.scalars(
        select(TrackRecord)
        .where(TrackRecord.id.in_(_window_ids(session, bounds)))
        .order_by(TrackRecord.ended_s, TrackRecord.id)
    ).all()


def count_from(
    session: Session, camera_id: str, started_from_s: float | None, without: Spans = ()
) -> int:
    """How many tracks started at or after a time and were not seen at others."""
    query = select(func.count()).select_from(TrackRecord)
    wanted = (*_started_from(camera_id, started_from_s), *outside(without))
    return session.scalar(query.where(*wanted)) or 0


def count_window(session: Session, bounds: WindowBounds) -> int:
    """How many tracks are in a window."""
    query = select(func.count()).select_from(_window_ids(session, bounds).subquery())
    return session.scalar(query) or 0


def first(
    session: Session,
    camera_id: str,
    started_from_s: float | None,
    limit: int,
    without: Spans = (),
) -> Sequence[TrackRecord]:
    """The first tracks by their ends that started from a time on and were not seen at others."""
    return session.scalars(
        select(TrackRecord)
        .where(*_started_from(camera_id, started_from_s), *outside(without))
        .order_by(TrackRecord.ended_s, TrackRecord.id)
        .limit(limit)
    ).all()


def still(session: Session, bounds: StillBounds, limit: int) -> Sequence[TrackRecord]:
    """The newest so many tracks of a camera at its prior pose, in the order of their ends."""
    return session.scalars(
        select(TrackRecord)
        .where(*_still(bounds))
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(limit)
    ).all()[::-1]


def count_still(session: Session, bounds: StillBounds, ended_after_s: float | None) -> int:
    """How many tracks of a camera at its prior pose ended after a time."""
    query = select(func.count()).select_from(TrackRecord).where(*_still(bounds))
    if ended_after_s is not None:
        query = query.where(TrackRecord.ended_s > ended_after_s)
    return session.scalar(query) or 0


def count_between(session: Session, camera_id: str, from_s: float, to_s: float) -> int:
    """How many tracks started after one time and before another."""
    query = select(func.count()).where(
        *_counting(camera_id),
        TrackRecord.started_s > from_s,
        TrackRecord.started_s < to_s,
    )
    return session.scalar(query) or 0


def a_year(session: Session, camera_id: str) -> float:
    """How many tracks a year come, by those of the newest four weeks; of a day at the least."""
    newest = newest_end_s(session, camera_id) or 0.0
    count, first = session.execute(
        select(func.count(), func.min(TrackRecord.ended_s)).where(
            *_counting(camera_id), TrackRecord.ended_s >= newest - _RECENT_S
        )
    ).one()
    span_s = max(newest - (first or newest), _DAY_S)
    return max(float(count), 1.0) * _YEAR_S / span_s


def newest(
    session: Session, camera_id: str, limit: int, started_from_s: float | None = None
) -> Sequence[TrackRecord]:
    """The newest tracks, newest first; of those that started from a time on, if it is given."""
    return session.scalars(
        select(TrackRecord)
        .where(*_started_from(camera_id, started_from_s))
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(limit)
    ).all()


def without_prediction(
    session: Session, bounds: WindowBounds, model_id: str, limit: int
) -> Sequence[TrackRecord]:
    """Tracks of the window that the model has not looked at, newest first."""
    return session.scalars(
        select(TrackRecord)
        .outerjoin(
            PredictionRecord,
            (PredictionRecord.track_pk == TrackRecord.id) & (PredictionRecord.model_id == model_id),
        )
        .where(
            TrackRecord.id.in_(_window_ids(session, bounds)),
            PredictionRecord.track_pk.is_(None),
        )
        .order_by(TrackRecord.ended_s.desc())
        .limit(limit)
    ).all()


def add_predictions(session: Session, rows: Sequence[dict[str, Any]]) -> None:
    """Insert predictions; a second run of the same job changes nothing."""
    if rows:
        session.execute(insert(PredictionRecord).on_conflict_do_nothing(), rows)


def predictions(
    session: Session, model_id: str, track_pks: Sequence[int]
) -> Sequence[PredictionRecord]:
    """What the model says of some tracks, newest first, of those that gave it something to say."""
    return session.scalars(
        select(PredictionRecord)
        .join(TrackRecord, PredictionRecord.track_pk == TrackRecord.id)
        .where(
            PredictionRecord.model_id == model_id,
            PredictionRecord.windows > 0,
            PredictionRecord.track_pk.in_(track_pks),
        )
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
    ).all()


def forget(session: Session, camera_id: str, before: datetime, keep: int, limit: int) -> int:
    """Delete what the limits on age and number say. Returns how many.

    At most `limit` at once, those first that came first.
    """
    outlived = _outlived(camera_id, before, keep)
    bite = select(TrackRecord.id).where(outlived).order_by(TrackRecord.id).limit(limit)
    result = session.execute(delete(TrackRecord).where(TrackRecord.id.in_(bite)))
    return int(result.rowcount)  # type: ignore[attr-defined]


def existing(session: Session, track_pks: Sequence[int]) -> set[int]:
    """Those of the given tracks that are still stored."""
    return set(session.scalars(select(TrackRecord.id).where(TrackRecord.id.in_(track_pks))))


def _outlived(camera_id: str, before: datetime, keep: int) -> ColumnElement[bool]:
    """Whether a track is to be deleted: it came before a time, or so many have come after it.

    By its arrival, not by its own times: what was recorded years ago and is posted today has been
    acknowledged today, and stays as long as what was walked today. The source that
    counts has a number of its own: no other can post its tracks away.
    """
    number = func.row_number().over(
        partition_by=of_counting_source(camera_id), order_by=TrackRecord.id.desc()
    )
    numbered = (
        select(TrackRecord.id, number.label("number"))
        .where(TrackRecord.camera_id == camera_id)
        .subquery()
    )
    surplus = select(numbered.c.id).where(numbered.c.number > keep)
    return and_(
        TrackRecord.camera_id == camera_id,
        (TrackRecord.received_at < before) | TrackRecord.id.in_(surplus),
    )


def of_counting_source(camera_id: str | InstrumentedAttribute[str]) -> ColumnElement[bool]:
    """Whether a track is of the source that counts; all are, as long as none does."""
    counting = _counting_source(camera_id).scalar_subquery()
    return TrackRecord.source == func.coalesce(counting, TrackRecord.source)


def _counting(camera_id: str) -> list[ColumnElement[bool]]:
    return [TrackRecord.camera_id == camera_id, of_counting_source(camera_id)]


def _counting_source(camera_id: str | InstrumentedAttribute[str]) -> Select[str | None]:
    reference = aliased(SiteReferenceRecord)
    newest = (
        select(reference.source)
        .where(reference.camera_id == camera_id)
        .order_by(reference.id.desc())
        .limit(1)
    )
    return newest if isinstance(camera_id, str) else newest.correlate(CameraRecord)


def _newest_source(camera_id: str | InstrumentedAttribute[str]) -> Select[str]:
    newest = (
        select(TrackRecord.source)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(1)
    )
    if not isinstance(camera_id, str):
        newest = newest.correlate(CameraRecord)
    return select(
        func.coalesce(_counting_source(camera_id).scalar_subquery(), newest.scalar_subquery())
    )


def _started_from(camera_id: str, started_from_s: float | None) -> list[ColumnElement[bool]]:
    conditions = _counting(camera_id)
    if started_from_s is not None:
        conditions.append(TrackRecord.started_s >= started_from_s)
    return conditions


def outside(spans: Spans) -> list[ColumnElement[bool]]:
    """That tracks were seen at none of some times."""
    return [
        (TrackRecord.ended_s < from_s) | (TrackRecord.started_s > to_s) for from_s, to_s in spans
    ]


def _still(bounds: StillBounds) -> list[ColumnElement[bool]]:
    newest = (
        select(TrackRecord.id)
        .where(*_counting(bounds.camera_id))
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(bounds.unsure)
    )
    later = and_(TrackRecord.id.not_in(newest), *outside(bounds.without))
    return [
        *_started_from(bounds.camera_id, bounds.started_from_s),
        *outside(bounds.attended),
        (TrackRecord.ended_s <= bounds.reference_to_s) | later,
    ]


def _window_ids(session: Session, bounds: WindowBounds) -> Select[int]:
    inside = [*_started_from(bounds.camera_id, bounds.started_from_s), *outside(bounds.without)]
    if bounds.ended_after_s is not None:
        inside.append(TrackRecord.ended_s > bounds.ended_after_s)
    if bounds.ended_from_s is not None:
        inside.append(TrackRecord.ended_s >= bounds.ended_from_s)
    # The camera's own clock, not ours.
    newest = session.scalar(select(func.max(TrackRecord.ended_s)).where(*inside)) or 0.0
    return (
        select(TrackRecord.id)
        .where(*inside, TrackRecord.ended_s >= newest - bounds.days * 86_400)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(bounds.tracks)
    )
