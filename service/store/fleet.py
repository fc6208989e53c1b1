"""Statements on many cameras at once, for pages and metrics: one for all, none for each.

Those that each request for a pose asks are built once: building takes longer than asking.
"""

import math
from collections import defaultdict, namedtuple
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache, lru_cache
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Float,
    Row,
    Select,
    String,
    bindparam,
    case,
    column,
    exists,
    func,
    select,
    true,
    values,
)
from sqlalchemy.orm import Bundle, InstrumentedAttribute, Session, aliased, defer

from models.monitoring.drift import DriftLimits
from service.enums import AlertState, Origin
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord, PriorPoseRecord, RhythmRecord, newest_of
from service.store.engines.dialects import as_json, contains_word, largest
from service.store.estimates import EstimateRecord
from service.store.pictures import PictureRecord
from service.store.references import MaintenanceRecord, SiteReferenceRecord
from service.store.tracks import Spans, TrackRecord
from service.store.trainings import UNFINISHED, TrainingRecord

# Which cameras are asked about; None is all.
Ids = Collection[str] | None

_IDS = "ids"


@dataclass(frozen=True, slots=True, kw_only=True)
class Newest:
    """The newest rows of a camera, and signs of more to know.

    The active reference comes without the site itself and, for several cameras, the estimate
    without its evidence. `last_track_s` is the end of the newest track of the active source;
    `usual_gap_s` and `delay_s` come from the arrival model, if there is one. `fires` is true if an
    alert is open, `attended` if there are maintenance windows, `assumed` if the prior pose was
    never given or confirmed. `images` counts the images compared with that pose's first.
    """

    reference: SiteReferenceRecord
    estimate: EstimateRecord | None
    last_track_s: float | None
    usual_gap_s: float | None
    delay_s: float | None
    fires: bool
    attended: bool
    assumed: bool
    images: int


def newest(session: Session, ids: Ids = None, *, lean: bool = False) -> dict[str, Newest]:
    """The newest rows of each camera, in order of their ids; `lean`: what tells states alone.

    Of thousands of cameras the rest takes twice as long, most of it to read JSON.
    """
    query = _newest(some=ids is not None, whole=ids is not None and len(ids) == 1, lean=lean)
    return {
        camera_id: Newest(
            reference=reference,
            estimate=None if estimate is None or estimate.id is None else estimate,
            last_track_s=ended_s,
            usual_gap_s=gap_s,
            delay_s=delay_s,
            fires=bool(fires),
            attended=bool(attended),
            assumed=origin == Origin.ASSUMED,
            images=images or 0,
        )
        for (
            camera_id,
            reference,
            estimate,
            ended_s,
            gap_s,
            delay_s,
            fires,
            attended,
            origin,
            images,
        ) in session.execute(query, given(ids))
    }


def newest_identifiable_estimates(
    session: Session, ids: Collection[str]
) -> dict[str, EstimateRecord]:
    """The newest estimate of each of some cameras of which something is identifiable.

    Without what is behind it.
    """
    newest = (
        select(EstimateRecord.id)
        .where(EstimateRecord.camera_id == CameraRecord.id)
        .where(as_json(EstimateRecord.identifiable) != "[]")
        .order_by(EstimateRecord.id.desc())
        .limit(1)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    query = select(EstimateRecord).join(CameraRecord, EstimateRecord.id == newest)
    query = query.where(CameraRecord.id.in_(ids)).options(defer(EstimateRecord.raw))
    return {record.camera_id: record for record in session.scalars(query)}


_named: Any = cache(namedtuple)


class _Lean(Bundle[Any]):
    """Columns of a record as a plain tuple with their names.

    SQLAlchemy's own rows look each name up in a table: a third of what thousands of states take.
    """

    inherit_cache = True

    def create_row_processor(
        self, query: Select[Any], procs: Sequence[Callable[[Row[Any]], Any]], labels: Sequence[str]
    ) -> Callable[[Row[Any]], Any]:
        make = _named(self.name, tuple(labels))._make
        return lambda row: make([value(row) for value in procs])


# Rows of what tells states: whatever else is asked of one is an error, and no statement more.
_E, _R = EstimateRecord, SiteReferenceRecord
_LEAN: tuple[Any, Any] = (
    _Lean(
        _R.__tablename__,
        *(_R.id, _R.camera_id, _R.source, _R.origin, _R.from_s, _R.to_s, _R.window_from_s),
        *(_R.answer, _R.answered_at, _R.created_at, _R.ready_at),
    ),
    _Lean(
        _E.__tablename__,
        *(_E.id, _E.reference_id, _E.state, _E.identifiable),
        *(_E.drift_since, _E.to_s, _E.created_at),
    ),
)


@cache
def _newest(*, some: bool, whole: bool, lean: bool) -> Select[Any]:
    """One statement: each that a request for a pose asks takes as long as all it looks up."""
    # Of the source that counts, which is that of the newest reference; of all where it has none.
    counts = TrackRecord.source == func.coalesce(SiteReferenceRecord.source, TrackRecord.source)
    last = select(func.max(TrackRecord.ended_s)).where(
        TrackRecord.camera_id == CameraRecord.id, counts
    )
    fires = exists().where(
        AlertRecord.camera_id == CameraRecord.id, AlertRecord.state == AlertState.FIRING
    )
    attended = exists().where(MaintenanceRecord.camera_id == CameraRecord.id)
    reference = newest_of(SiteReferenceRecord.id, SiteReferenceRecord.camera_id)
    estimate = newest_of(EstimateRecord.id, EstimateRecord.camera_id)
    query = (
        select(
            CameraRecord.id,
            *(_LEAN if lean else (SiteReferenceRecord, EstimateRecord)),
            last.correlate(CameraRecord, SiteReferenceRecord).scalar_subquery(),
            RhythmRecord.usual_gap_s,
            RhythmRecord.delay_s,
            fires.correlate(CameraRecord),
            attended.correlate(CameraRecord),
            PriorPoseRecord.origin,
            PictureRecord.compared,
        )
        .select_from(CameraRecord)
        .join(SiteReferenceRecord, SiteReferenceRecord.id == reference)
        .join(PriorPoseRecord, PriorPoseRecord.id == SiteReferenceRecord.prior_pose_id)
        .outerjoin(EstimateRecord, EstimateRecord.id == estimate)
        .outerjoin(RhythmRecord, RhythmRecord.camera_id == CameraRecord.id)
        .outerjoin(
            PictureRecord,
            (PictureRecord.camera_id == CameraRecord.id)
            & (PictureRecord.prior_pose_id == PriorPoseRecord.id),
        )
        .where(among_given(CameraRecord.id, some=some))
        .order_by(CameraRecord.id)
    )
    if lean:
        return query
    query = query.options(defer(SiteReferenceRecord.data))
    return query if whole else query.options(defer(EstimateRecord.raw))


def among(column: InstrumentedAttribute[Any], ids: Ids) -> ColumnElement[bool]:
    """The condition that a column names one of the cameras that are asked about."""
    return true() if ids is None else column.in_(ids)


def among_given(column: InstrumentedAttribute[Any], *, some: bool) -> ColumnElement[bool]:
    """The same in a statement that is built once: the cameras are `given` with each execution."""
    return column.in_(bindparam(_IDS, expanding=True)) if some else true()


def given(ids: Ids) -> dict[str, list[str]]:
    """The parameters of such a statement."""
    return {} if ids is None else {_IDS: list(ids)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """The name of a camera, and where it belongs; an empty site is none."""

    name: str
    site: str = ""
    tags: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """Site and tags in a line, such as "campus/north #outdoor", as pages read it, too."""
        return _place_of(self.site, self.tags)


@lru_cache(maxsize=1024)  # a fleet's places are few, and a page asks for each camera's
def _place_of(site: str, tags: tuple[str, ...]) -> str:
    return " ".join([*([site] if site else []), *(f"#{tag}" for tag in tags)])


def labels(session: Session, ids: Ids) -> dict[str, Label]:
    """The label of each camera."""
    c = CameraRecord
    query = select(c.id, c.name, c.site, c.tags).where(among(c.id, ids))
    return {
        camera_id: Label(name=name, site=site or "", tags=tuple(tags))
        for camera_id, name, site, tags in session.execute(query)
    }


def names(session: Session, ids: Ids) -> list[tuple[str, str]]:
    """Id and name of each camera."""
    query = select(CameraRecord.id, CameraRecord.name).where(among(CameraRecord.id, ids))
    return [(camera_id, name) for camera_id, name in session.execute(query)]


def drift_history(
    session: Session, ids: Ids, count: int, limits: DriftLimits
) -> dict[str, list[float | None]]:
    """The drifts of the newest so many estimates of each camera in units of the limits.

    Oldest first; the largest of what an estimate told, None where it told nothing. In
    SQL: thousands of estimates are one number each.
    """
    earlier = aliased(EstimateRecord)
    first = (
        select(earlier.id)
        .where(earlier.camera_id == CameraRecord.id)
        .order_by(earlier.id.desc())
        .limit(1)
        .offset(count - 1)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    e = EstimateRecord
    drifts = {
        "tilt": e.drift_tilt_rad,
        "roll": e.drift_roll_rad,
        "heading": e.drift_heading_rad,
        "height": e.drift_height_m,
    }
    ratios = [_ratio(name, drift, limits.floor(name)) for name, drift in drifts.items()]
    query = (
        select(CameraRecord.id, e.id, func.nullif(largest(*ratios), -1.0))
        # Outer: cameras come first, and of each only its newest estimates are looked at.
        .outerjoin(e, (e.camera_id == CameraRecord.id) & (e.id >= func.coalesce(first, 0)))
        .where(among(CameraRecord.id, ids))
        .order_by(CameraRecord.id, e.id)
    )
    found: dict[str, list[float | None]] = defaultdict(list)
    for camera_id, estimate_id, ratio in session.connection().execute(query):
        if estimate_id is not None:
            found[camera_id].append(ratio)
    return found


def learning_counts(session: Session, ids: Ids, without: Mapping[str, Spans]) -> dict[str, int]:
    """The number of tracks that the reference being learned of each camera may be made of.

    Of those of a camera that were seen at any time `without`, none.
    """
    some = ids is not None
    if any(without.values()):
        query = _learning_counts(~_seen_within(without), some=some)
    else:
        query = _all_learning_counts(some=some)
    return {camera_id: number for camera_id, number in session.execute(query, given(ids))}


@cache
def _all_learning_counts(*, some: bool) -> Select[str, int]:
    return _learning_counts(true(), some=some)


def _learning_counts(counts: ColumnElement[bool], *, some: bool) -> Select[str, int]:
    begun = func.coalesce(SiteReferenceRecord.from_s, -math.inf)
    wanted = [
        TrackRecord.camera_id == CameraRecord.id,
        TrackRecord.started_s >= begun,
        TrackRecord.source == func.coalesce(SiteReferenceRecord.source, TrackRecord.source),
        counts,
    ]
    count = (
        select(func.count())
        .where(*wanted)
        .correlate(CameraRecord, SiteReferenceRecord)
        .scalar_subquery()
    )
    other = aliased(SiteReferenceRecord)
    newest = newest_of(other.id, other.camera_id)
    return (
        select(CameraRecord.id, count)
        .join(SiteReferenceRecord, SiteReferenceRecord.id == newest)
        .where(
            among_given(CameraRecord.id, some=some),
            SiteReferenceRecord.ready_at.is_(None),
        )
    )


def result_times(
    session: Session,
) -> list[tuple[str, datetime, datetime | None, datetime | None]]:
    """The times of each camera that has tracks, in order of ids.

    Returns:
        The camera, when its newest track arrived, when it was checked and its newest estimate made.
    """
    newest = select(func.max(TrackRecord.id)).where(TrackRecord.camera_id == CameraRecord.id)
    query = (
        select(
            CameraRecord.id,
            TrackRecord.received_at,
            CameraRecord.checked_at,
            EstimateRecord.created_at,
        )
        .join(TrackRecord, TrackRecord.id == newest.correlate(CameraRecord).scalar_subquery())
        .outerjoin(
            EstimateRecord,
            EstimateRecord.id == newest_of(EstimateRecord.id, EstimateRecord.camera_id),
        )
        .order_by(CameraRecord.id)
    )
    return [(row[0], row[1], row[2], row[3]) for row in session.execute(query)]


def firing(session: Session, ids: Ids) -> Sequence[AlertRecord]:
    """The alerts of cameras that fire, those about one camera."""
    return session.scalars(_firing(some=ids is not None), given(ids)).all()


def firing_groups(session: Session) -> Sequence[AlertRecord]:
    """The alerts of groups that fire, the newest first."""
    return session.scalars(
        select(AlertRecord)
        .where(AlertRecord.state == AlertState.FIRING, AlertRecord.camera_id.is_(None))
        .order_by(AlertRecord.opened_at.desc())
    ).all()


def unfinished_trainings(session: Session, ids: Ids) -> dict[str, TrainingRecord]:
    """The training of each camera that is under way or waits; of several the one that began."""
    query = (
        select(TrainingRecord)
        .where(TrainingRecord.state.in_(UNFINISHED), among(TrainingRecord.camera_id, ids))
        .order_by(TrainingRecord.state, TrainingRecord.queued_at.desc())
    )
    return {record.camera_id: record for record in session.scalars(query)}


def maintenance_windows(session: Session, ids: Ids) -> dict[str, list[MaintenanceRecord]]:
    """The windows of each camera in the order of their beginnings."""
    found: dict[str, list[MaintenanceRecord]] = defaultdict(list)
    for record in session.scalars(_maintenance_windows(some=ids is not None), given(ids)):
        found[record.camera_id].append(record)
    return found


@cache
def _firing(*, some: bool) -> Select[AlertRecord]:
    query = select(AlertRecord).where(
        AlertRecord.state == AlertState.FIRING, AlertRecord.camera_id.is_not(None)
    )
    return query.where(among_given(AlertRecord.camera_id, some=some))


@cache
def _maintenance_windows(*, some: bool) -> Select[MaintenanceRecord]:
    query = select(MaintenanceRecord).where(among_given(MaintenanceRecord.camera_id, some=some))
    return query.order_by(MaintenanceRecord.from_at, MaintenanceRecord.id)


def _seen_within(spans: Mapping[str, Spans]) -> ColumnElement[bool]:
    """The condition of being seen at any of some times of a camera: what `outside` denies."""
    rows = [(camera_id, *span) for camera_id, each in spans.items() for span in each]
    columns = column("camera_id", String), column("from_s", Float), column("to_s", Float)
    times = values(*columns, name="times").data(rows).cte("times")
    within = select(times.c.camera_id).where(
        times.c.camera_id == TrackRecord.camera_id,
        TrackRecord.ended_s >= times.c.from_s,
        TrackRecord.started_s <= times.c.to_s,
    )
    return within.correlate(TrackRecord).exists()


def _ratio(name: str, drift: Any, floor: float) -> ColumnElement[float]:
    """A number's drift in units of its floor; -1 where it is not identifiable."""
    identifiable = contains_word(EstimateRecord.identifiable, name)
    return case((identifiable, func.abs(drift) / max(floor, 1e-12)), else_=-1.0)
