"""Which of a camera's tracks count: those of the source that its reference is of."""

from sqlalchemy import BindParameter, ColumnElement, Select, func, select
from sqlalchemy.orm import InstrumentedAttribute, aliased

from service.store.tables.cameras import CameraRecord
from service.store.tables.references import SiteReferenceRecord
from service.store.tables.tracks import TrackRecord

# Made once: each alias has columns of its own, which take a millisecond to make.
_Reference = aliased(SiteReferenceRecord)

# A camera by its id, by that of an enclosing query, or by a value that is given later.
CameraId = str | InstrumentedAttribute[str] | BindParameter[str]
Spans = tuple[tuple[float, float], ...]  # times, from and to


def bytes_of_track() -> ColumnElement[int]:
    """How many bytes a track's points, boxes and heads have."""
    return (
        func.length(TrackRecord.points)
        + func.coalesce(func.length(TrackRecord.boxes), 0)
        + func.coalesce(func.length(TrackRecord.heads), 0)
    )


def of_counting_source(camera_id: CameraId) -> ColumnElement[bool]:
    """Whether a track is of the source that counts; all are, as long as none does."""
    counting = counting_source(camera_id).scalar_subquery()
    return TrackRecord.source == func.coalesce(counting, TrackRecord.source)


def counting(camera_id: str | BindParameter[str]) -> list[ColumnElement[bool]]:
    """That a track is of a camera, and of the source that counts."""
    return [TrackRecord.camera_id == camera_id, of_counting_source(camera_id)]


def counting_source(camera_id: CameraId) -> Select[str | None]:
    """The source of a camera's newest reference."""
    newest = (
        select(_Reference.source)
        .where(_Reference.camera_id == camera_id)
        .order_by(_Reference.id.desc())
        .limit(1)
    )
    return (
        newest.correlate(CameraRecord) if isinstance(camera_id, InstrumentedAttribute) else newest
    )


def newest_source_of(camera_id: str | InstrumentedAttribute[str]) -> Select[str]:
    """The source that counts; where none does, that of the newest track."""
    newest = (
        select(TrackRecord.source)
        .where(TrackRecord.camera_id == camera_id)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(1)
    )
    if not isinstance(camera_id, str):
        newest = newest.correlate(CameraRecord)
    return select(
        func.coalesce(counting_source(camera_id).scalar_subquery(), newest.scalar_subquery())
    )


def started_from(camera_id: str, started_from_s: float | None) -> list[ColumnElement[bool]]:
    """That a track counts and started at or after a time."""
    conditions = counting(camera_id)
    if started_from_s is not None:
        conditions.append(TrackRecord.started_s >= started_from_s)
    return conditions


def outside(spans: Spans) -> list[ColumnElement[bool]]:
    """That tracks were seen at none of some times."""
    return [
        (TrackRecord.ended_s < from_s) | (TrackRecord.started_s > to_s) for from_s, to_s in spans
    ]
