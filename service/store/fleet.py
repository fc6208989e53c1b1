"""Statements that the fleet page asks of many cameras at once: each one for all, none for each."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Float,
    Select,
    String,
    case,
    column,
    func,
    select,
    true,
    values,
)
from sqlalchemy.orm import Session, aliased

from models.monitoring.verdict import DriftLimits
from service.enums import AlertState
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord, newest_of
from service.store.engines.dialects import contains_word, largest
from service.store.estimates import EstimateRecord
from service.store.maintenance import MaintenanceRecord
from service.store.metrics import Ids, among, among_given, given
from service.store.references import SiteReferenceRecord
from service.store.stored_tracks import Spans, TrackRecord
from service.store.trainings import UNFINISHED, TrainingRecord


def names(session: Session, ids: Ids) -> list[tuple[str, str]]:
    """Id and name of each camera."""
    query = select(CameraRecord.id, CameraRecord.name).where(among(CameraRecord.id, ids))
    return [(camera_id, name) for camera_id, name in session.execute(query)]


def drift_history(
    session: Session, ids: Ids, count: int, limits: DriftLimits
) -> dict[str, list[float | None]]:
    """The drifts of the newest so many estimates of each camera in units of the limits.

    Oldest first; the largest of what an estimate told, None where it told nothing. What
    `DriftLimits.of` says, said in SQL: thousands of estimates are one number each.
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
    ratios = [
        _ratio("tilt", e.drift_tilt_rad, e.tilt_sd_rad, limits, limits.floor_rad),
        _ratio("roll", e.drift_roll_rad, e.roll_sd_rad, limits, limits.floor_rad),
        _ratio("heading", e.drift_heading_rad, e.heading_sd_rad, limits, limits.floor_rad),
        _ratio("height", e.drift_height_m, e.height_sd_m, limits, limits.floor_m),
    ]
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


def _ratio(
    name: str, drift: Any, sd: Any, limits: DriftLimits, floor: float
) -> ColumnElement[float]:
    """A number's drift in units of its limit; -1 where it is not identifiable."""
    identifiable = contains_word(EstimateRecord.identifiable, name)
    limit = largest(limits.sigmas * func.coalesce(sd, 0.0), floor, 1e-12)
    return case((identifiable, func.abs(drift) / limit), else_=-1.0)
