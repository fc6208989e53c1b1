"""Statements on the tracks of a window, and of the times when a camera stood still."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Select, and_, func, select
from sqlalchemy.orm import Session

from service.store.tables.tracks import TrackRecord
from service.store.tracks.counting import Spans, counting, outside, started_from


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


def window(session: Session, bounds: WindowBounds) -> Sequence[TrackRecord]:
    """The tracks of a window in the order of their ends."""
    return session.scalars(
        select(TrackRecord)
        .where(TrackRecord.id.in_(window_ids(session, bounds)))
        .order_by(TrackRecord.ended_s, TrackRecord.id)
    ).all()


def count_from(
    session: Session, camera_id: str, started_from_s: float | None, without: Spans = ()
) -> int:
    """How many tracks started at or after a time and were not seen at others."""
    query = select(func.count()).select_from(TrackRecord)
    wanted = (*started_from(camera_id, started_from_s), *outside(without))
    return session.scalar(query.where(*wanted)) or 0


def count_window(session: Session, bounds: WindowBounds) -> int:
    """How many tracks are in a window."""
    query = select(func.count()).select_from(window_ids(session, bounds).subquery())
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
        .where(*started_from(camera_id, started_from_s), *outside(without))
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


def _still(bounds: StillBounds) -> list[ColumnElement[bool]]:
    newest = (
        select(TrackRecord.id)
        .where(*counting(bounds.camera_id))
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(bounds.unsure)
    )
    later = and_(TrackRecord.id.not_in(newest), *outside(bounds.without))
    return [
        *started_from(bounds.camera_id, bounds.started_from_s),
        *outside(bounds.attended),
        (TrackRecord.ended_s <= bounds.reference_to_s) | later,
    ]


def window_ids(session: Session, bounds: WindowBounds) -> Select[int]:
    """The tracks of a window, newest first."""
    inside = [*started_from(bounds.camera_id, bounds.started_from_s), *outside(bounds.without)]
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
