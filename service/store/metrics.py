"""Statements that look at everything at once, for metrics: a lookup a camera, never a scan.

Those that each request for a pose asks are built once: building takes longer than asking.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Select,
    bindparam,
    exists,
    func,
    select,
    true,
)
from sqlalchemy.orm import InstrumentedAttribute, Session, defer

from service.enums import AlertState, DeliveryState, TrainingState
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord, newest_of
from service.store.engines.dialects import as_json
from service.store.estimates import EstimateRecord
from service.store.maintenance import MaintenanceRecord
from service.store.references import SiteReferenceRecord
from service.store.rhythms import RhythmRecord
from service.store.stored_tracks import TrackRecord, of_counting_source
from service.store.trainings import TrainingRecord
from service.store.webhooks import DeliveryRecord
from service.store.workers import WorkerRecord

# Which cameras are asked about; None is all.
Ids = Collection[str] | None

_IDS = "ids"


@dataclass(frozen=True, slots=True, kw_only=True)
class Newest:
    """The newest rows of a camera, and signs of more to know.

    The reference that counts comes without the site itself, and of several cameras the estimate
    without what is behind it. `last_track_s` is when the newest track ended of those that count.
    `fires` says that an alert does, `attended` that there are maintenance windows.
    """

    reference: SiteReferenceRecord
    estimate: EstimateRecord | None
    last_track_s: float | None
    rhythm: dict[str, Any] | None
    fires: bool
    attended: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlog:
    """Deliveries that wait for a webhook, and since when."""

    count: int
    oldest_at: datetime


def newest(session: Session, ids: Ids = None) -> dict[str, Newest]:
    """The newest rows of each camera, in order of their ids."""
    query = _newest(some=ids is not None, whole=ids is not None and len(ids) == 1)
    return {
        camera_id: Newest(
            reference=reference,
            estimate=estimate,
            last_track_s=ended_s,
            rhythm=profile or None,
            fires=bool(fires),
            attended=bool(attended),
        )
        for camera_id, reference, estimate, ended_s, profile, fires, attended in session.execute(
            query, given(ids)
        )
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


def firing(session: Session) -> Sequence[AlertRecord]:
    """All alerts that fire, members of groups among them."""
    return session.scalars(select(AlertRecord).where(AlertRecord.state == AlertState.FIRING)).all()


def trainings_by_state(session: Session) -> dict[TrainingState, int]:
    """The number of stored trainings in each state."""
    rows = session.execute(
        select(TrainingRecord.state, func.count()).group_by(TrainingRecord.state)
    )
    return {state: count for state, count in rows}


def workers(session: Session) -> Sequence[WorkerRecord]:
    """All workers, those that are lost among them."""
    return session.scalars(select(WorkerRecord).order_by(WorkerRecord.name)).all()


def backlogs(session: Session) -> dict[str, Backlog]:
    """The backlog of each webhook that something waits for."""
    rows = session.execute(
        select(DeliveryRecord.webhook_id, func.count(), func.min(DeliveryRecord.created_at))
        .where(DeliveryRecord.state == DeliveryState.PENDING)
        .group_by(DeliveryRecord.webhook_id)
    )
    return {name: Backlog(count=count, oldest_at=oldest) for name, count, oldest in rows}


@cache
def _newest(*, some: bool, whole: bool) -> Select[Any]:
    """One statement: each that a request for a pose asks takes as long as all it looks up."""
    of_camera = TrackRecord.camera_id == CameraRecord.id
    last = select(func.max(TrackRecord.ended_s)).where(
        of_camera, of_counting_source(CameraRecord.id)
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
            SiteReferenceRecord,
            EstimateRecord,
            last.correlate(CameraRecord).scalar_subquery(),
            RhythmRecord.profile,
            fires.correlate(CameraRecord),
            attended.correlate(CameraRecord),
        )
        .select_from(CameraRecord)
        .join(SiteReferenceRecord, SiteReferenceRecord.id == reference)
        .outerjoin(EstimateRecord, EstimateRecord.id == estimate)
        .outerjoin(RhythmRecord, RhythmRecord.camera_id == CameraRecord.id)
        .where(among_given(CameraRecord.id, some=some))
        .order_by(CameraRecord.id)
        .options(defer(SiteReferenceRecord.data))
    )
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
