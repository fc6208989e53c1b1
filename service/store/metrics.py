"""Statements that look at everything at once, for metrics: a lookup a camera, never a scan.

Those that each request for a pose asks are built once: building takes longer than asking.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any

from sqlalchemy import ColumnElement, Select, String, bindparam, func, select, true, type_coerce
from sqlalchemy.orm import InstrumentedAttribute, Session, defer

from service.kinds import AlertState, DeliveryState, TrainingState
from service.store.tables.alerts import AlertRecord
from service.store.tables.cameras import CameraRecord
from service.store.tables.deliveries import DeliveryRecord
from service.store.tables.estimates import EstimateRecord
from service.store.tables.operation import WorkerRecord
from service.store.tables.references import SiteReferenceRecord
from service.store.tables.tracks import TrackRecord
from service.store.tables.trainings import TrainingRecord
from service.store.tracks.counting import of_counting_source

# Which cameras are asked about; None is all.
Ids = Collection[str] | None

_IDS = "ids"


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlog:
    """What waits for a webhook, and since when."""

    count: int
    oldest_at: datetime


def last_tracks_s(session: Session, ids: Ids = None) -> dict[str, float | None]:
    """When the newest track of each camera ended, of those that count."""
    rows = session.execute(_last_tracks_s(some=ids is not None), given(ids))
    return {camera_id: ended_s for camera_id, ended_s in rows}


def newest_references(session: Session, ids: Ids = None) -> dict[str, SiteReferenceRecord]:
    """The reference of each camera that counts, without the site itself."""
    query = _newest_references(some=ids is not None)
    return {record.camera_id: record for record in session.scalars(query, given(ids))}


def newest_estimates(session: Session, ids: Ids = None) -> dict[str, EstimateRecord]:
    """The newest estimate of each camera; of several, without what is behind it."""
    query = _newest_estimates(some=ids is not None, whole=ids is not None and len(ids) == 1)
    return {record.camera_id: record for record in session.scalars(query, given(ids))}


def newest_identifiable_estimates(
    session: Session, ids: Collection[str]
) -> dict[str, EstimateRecord]:
    """The newest estimate of each of some cameras of which something is identifiable.

    Without what is behind it.
    """
    newest = (
        select(EstimateRecord.id)
        .where(EstimateRecord.camera_id == CameraRecord.id)
        .where(type_coerce(EstimateRecord.identifiable, String) != "[]")
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
    """How many trainings are stored in each state."""
    rows = session.execute(
        select(TrainingRecord.state, func.count()).group_by(TrainingRecord.state)
    )
    return {state: count for state, count in rows}


def workers(session: Session) -> Sequence[WorkerRecord]:
    """All workers, those that are lost among them."""
    return session.scalars(select(WorkerRecord).order_by(WorkerRecord.name)).all()


def backlogs(session: Session) -> dict[str, Backlog]:
    """What waits for each webhook that something waits for."""
    rows = session.execute(
        select(DeliveryRecord.webhook_id, func.count(), func.min(DeliveryRecord.created_at))
        .where(DeliveryRecord.state == DeliveryState.PENDING)
        .group_by(DeliveryRecord.webhook_id)
    )
    return {name: Backlog(count=count, oldest_at=oldest) for name, count, oldest in rows}


@cache
def _last_tracks_s(*, some: bool) -> Select[str, float | None]:
    newest = (
        select(func.max(TrackRecord.ended_s))
        .where(TrackRecord.camera_id == CameraRecord.id, of_counting_source(CameraRecord.id))
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    query = select(CameraRecord.id, newest).where(among_given(CameraRecord.id, some=some))
    return query.order_by(CameraRecord.id)


@cache
def _newest_references(*, some: bool) -> Select[SiteReferenceRecord]:
    newest = newest_of(SiteReferenceRecord.id, SiteReferenceRecord.camera_id)
    query = select(SiteReferenceRecord).join(CameraRecord, SiteReferenceRecord.id == newest)
    query = query.where(among_given(CameraRecord.id, some=some))
    return query.options(defer(SiteReferenceRecord.data))


@cache
def _newest_estimates(*, some: bool, whole: bool) -> Select[EstimateRecord]:
    newest = newest_of(EstimateRecord.id, EstimateRecord.camera_id)
    query = select(EstimateRecord).join(CameraRecord, EstimateRecord.id == newest)
    query = query.where(among_given(CameraRecord.id, some=some))
    return query if whole else query.options(defer(EstimateRecord.raw))


def among(column: InstrumentedAttribute[Any], ids: Ids) -> ColumnElement[bool]:
    """Whether a column names one of the cameras that are asked about."""
    return true() if ids is None else column.in_(ids)


def among_given(column: InstrumentedAttribute[Any], *, some: bool) -> ColumnElement[bool]:
    """The same in a statement that is built once: the cameras are `given` with each execution."""
    return column.in_(bindparam(_IDS, expanding=True)) if some else true()


def given(ids: Ids) -> dict[str, list[str]]:
    """What such a statement is executed with."""
    return {} if ids is None else {_IDS: list(ids)}


def newest_of(
    column: InstrumentedAttribute[Any], camera_id: InstrumentedAttribute[str]
) -> ColumnElement[Any]:
    """The largest value of a column among what is stored of each camera: a lookup in an index."""
    return (
        select(func.max(column))
        .where(camera_id == CameraRecord.id)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
