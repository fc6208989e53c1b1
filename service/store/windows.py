"""Windows of tracks, times when a camera stood still, and models' predictions on tracks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    ForeignKey,
    Select,
    String,
    and_,
    bindparam,
    delete,
    exists,
    func,
    select,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from models.durations import DAY_S
from service.store.engines.dialects import new_rows, whole
from service.store.record import Record, count_where, foreign_key
from service.store.run_budget import RunBudget, TrackSize
from service.store.tracks import (
    SIZE_COLUMNS,
    Spans,
    StoredTrack,
    TrackRecord,
    by_end,
    counting,
    outside,
    started_from,
)


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
    `reference_to_s`. Of later ones, those count that ended before `later_before_s`, and not the
    newest `unsure` of all its tracks, nor those that were seen at any time `without`. Of neither do
    those that were seen while somebody `attended` to the camera.
    """

    camera_id: str
    started_from_s: float | None
    reference_to_s: float
    later_before_s: float | None
    unsure: int
    without: Spans
    attended: Spans = ()


def window(
    session: Session, bounds: WindowBounds, budget: RunBudget | None = None
) -> Sequence[StoredTrack]:
    """The tracks of a window in the order of their ends."""
    return by_end(session, TrackRecord.id.in_(window_ids(session, bounds)), budget=budget)


class NewTrack(NamedTuple):
    """Size and times of a track that the monitor's state does not have yet."""

    started_s: float
    ended_s: float
    size: TrackSize


# Built once: each monitor run asks for it.
_NEWER_THAN = select(TrackRecord.started_s, TrackRecord.ended_s, *SIZE_COLUMNS).where(
    *counting(bindparam("camera", type_=String)),
    TrackRecord.id > bindparam("newest_pk"),
    TrackRecord.started_s >= bindparam("started_from_s"),
    # Sums, so that SQLite goes by the index of keys: that of ends has the whole window.
    TrackRecord.ended_s + 0.0 > bindparam("ended_after_s"),
    TrackRecord.ended_s + 0.0 >= bindparam("ended_from_s"),
)
_NO_BOUND_S = -1e18  # before all times of tracks


def newer_than(session: Session, bounds: WindowBounds, newest_pk: int) -> list[NewTrack]:
    """Tracks within bounds that were stored after one, without their points."""
    names = "started_from_s", "ended_after_s", "ended_from_s"
    times = {name: getattr(bounds, name) for name in names}
    values = {name: _NO_BOUND_S if at is None else at for name, at in times.items()}
    query = _NEWER_THAN.where(*outside(bounds.without)) if bounds.without else _NEWER_THAN
    rows = session.execute(query, {**values, "camera": bounds.camera_id, "newest_pk": newest_pk})
    return [
        NewTrack(started_s=row[0], ended_s=row[1], size=TrackSize._make(row[2:])) for row in rows
    ]


def count_window(session: Session, bounds: WindowBounds) -> int:
    """The number of tracks in a window."""
    query = select(func.count()).select_from(window_ids(session, bounds).subquery())
    return session.scalar(query) or 0


def first(
    session: Session,
    camera_id: str,
    started_from_s: float | None,
    limit: int,
    without: Spans = (),
    budget: RunBudget | None = None,
) -> Sequence[StoredTrack]:
    """The first tracks by their ends that started from a time on and were not seen at others."""
    conditions = *started_from(camera_id, started_from_s), *outside(without)
    return by_end(session, *conditions, limit=limit, budget=budget)


def still(
    session: Session, bounds: StillBounds, limit: int, budget: RunBudget | None = None
) -> Sequence[StoredTrack]:
    """The newest so many tracks of a camera at its prior pose, in the order of their ends."""
    return by_end(session, *_still(bounds), newest_first=True, limit=limit, budget=budget)[::-1]


def count_still(session: Session, bounds: StillBounds, ended_after_s: float | None) -> int:
    """The number of tracks of a camera at its prior pose that ended after a time."""
    after = [] if ended_after_s is None else [TrackRecord.ended_s > ended_after_s]
    return count_where(session, *_still(bounds), *after)


def _still(bounds: StillBounds) -> list[ColumnElement[bool]]:
    newest = (
        select(TrackRecord.id)
        .where(*counting(bounds.camera_id))
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(bounds.unsure)
    )
    later = and_(TrackRecord.id.not_in(newest), *outside(bounds.without))
    if bounds.later_before_s is not None:
        later = and_(later, TrackRecord.ended_s < bounds.later_before_s)
    return [
        *started_from(bounds.camera_id, bounds.started_from_s),
        *outside(bounds.attended),
        (TrackRecord.ended_s <= bounds.reference_to_s) | later,
    ]


def newest_end_s(session: Session, bounds: WindowBounds) -> float | None:
    """The end of the newest track within bounds, however many they allow; None without any."""
    return session.scalar(select(func.max(TrackRecord.ended_s)).where(*_inside(bounds)))


def oldest_end_s(session: Session, bounds: WindowBounds) -> float | None:
    """The end of the oldest track of a window; None of an empty one."""
    ids = window_ids(session, bounds)
    return session.scalar(select(func.min(TrackRecord.ended_s)).where(TrackRecord.id.in_(ids)))


def of_days(
    session: Session,
    bounds: WindowBounds,
    after_s: float,
    to_s: float,
    most_a_day: int,
    budget: RunBudget | None = None,
) -> Sequence[StoredTrack]:
    """The tracks within bounds that ended after a time and before another, by their ends.

    However many tracks and days the bounds allow; of each day no more than so many, evenly.
    """
    day = whole(TrackRecord.ended_s / DAY_S)
    place = func.row_number().over(partition_by=day, order_by=(TrackRecord.ended_s, TrackRecord.id))
    each = (
        select(
            TrackRecord.id.label("id"),
            place.label("place"),
            func.count().over(partition_by=day).label("people"),
        )
        .where(*_inside(bounds), TrackRecord.ended_s > after_s, TrackRecord.ended_s < to_s)
        .subquery()
    )
    nth = (each.c.place * most_a_day) // each.c.people
    before = ((each.c.place - 1) * most_a_day) // each.c.people
    some = TrackRecord.id.in_(select(each.c.id).where(nth > before))
    return by_end(session, some, budget=budget)


def window_ids(session: Session, bounds: WindowBounds) -> Select[int]:
    """The tracks of a window, newest first."""
    inside = _inside(bounds)
    # The camera's own clock, not ours.
    newest = session.scalar(select(func.max(TrackRecord.ended_s)).where(*inside)) or 0.0
    return (
        select(TrackRecord.id)
        .where(*inside, TrackRecord.ended_s >= newest - bounds.days * DAY_S)
        .order_by(TrackRecord.ended_s.desc(), TrackRecord.id.desc())
        .limit(bounds.tracks)
    )


def _inside(bounds: WindowBounds) -> list[ColumnElement[bool]]:
    inside = [*started_from(bounds.camera_id, bounds.started_from_s), *outside(bounds.without)]
    if bounds.ended_after_s is not None:
        inside.append(TrackRecord.ended_s > bounds.ended_after_s)
    if bounds.ended_from_s is not None:
        inside.append(TrackRecord.ended_s >= bounds.ended_from_s)
    return inside


class PredictionRecord(Record):
    """A model's prediction on a track; without numbers where the track gives no window."""

    __tablename__ = "predictions"

    model_id: Mapped[str] = foreign_key("models.id", primary_key=True)
    track_pk: Mapped[int] = mapped_column(
        ForeignKey("tracks.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    windows: Mapped[int]
    height_m: Mapped[float | None]
    qw: Mapped[float | None]
    qx: Mapped[float | None]
    qy: Mapped[float | None]
    qz: Mapped[float | None]


def without_prediction(
    session: Session,
    bounds: WindowBounds,
    model_id: str,
    limit: int,
    budget: RunBudget | None = None,
) -> Sequence[StoredTrack]:
    """Tracks of the window that the model has not looked at, newest first."""
    predicted = exists().where(
        PredictionRecord.track_pk == TrackRecord.id, PredictionRecord.model_id == model_id
    )
    inside = TrackRecord.id.in_(window_ids(session, bounds))
    return by_end(session, inside, ~predicted, newest_first=True, limit=limit, budget=budget)


def add_predictions(session: Session, rows: Sequence[dict[str, Any]]) -> None:
    """Insert predictions; a second run of the same job changes nothing."""
    if rows:
        session.execute(new_rows(PredictionRecord.__table__), rows)


def forget_predictions(session: Session, camera_id: str, source: str) -> None:
    """Delete the predictions on the tracks of a source."""
    of_source = TrackRecord.camera_id == camera_id, TrackRecord.source == source
    pks = select(TrackRecord.id).where(*of_source)
    session.execute(delete(PredictionRecord).where(PredictionRecord.track_pk.in_(pks)))


def predictions(
    session: Session, model_id: str, track_pks: Sequence[int]
) -> Sequence[PredictionRecord]:
    """The model's predictions on some tracks, newest first, of those with a window."""
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
