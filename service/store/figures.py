"""Statements that look at everything at once, for metrics: a lookup a camera, never a scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session, defer

from service.store.delivery_tables import DeliveryRecord
from service.store.tables import (
    AlertRecord,
    CameraRecord,
    EstimateRecord,
    SiteReferenceRecord,
    TrackRecord,
    TrainingRecord,
    WorkerRecord,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlog:
    """What waits for a webhook, and since when."""

    count: int
    oldest_at: datetime


def last_tracks_s(session: Session) -> dict[str, float | None]:
    """When the newest track of each camera ended."""
    newest = (
        select(func.max(TrackRecord.ended_s))
        .where(TrackRecord.camera_id == CameraRecord.id)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    rows = session.execute(select(CameraRecord.id, newest).order_by(CameraRecord.id))
    return {camera_id: ended_s for camera_id, ended_s in rows}


def newest_references(session: Session) -> dict[str, SiteReferenceRecord]:
    """The reference of each camera that counts, without the site itself."""
    newest = (
        select(func.max(SiteReferenceRecord.id))
        .where(SiteReferenceRecord.camera_id == CameraRecord.id)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    query = select(SiteReferenceRecord).join(CameraRecord, SiteReferenceRecord.id == newest)
    records = session.scalars(query.options(defer(SiteReferenceRecord.data)))
    return {record.camera_id: record for record in records}


def newest_estimates(session: Session) -> dict[str, EstimateRecord]:
    """The newest estimate of each camera, without what is behind it."""
    newest = (
        select(func.max(EstimateRecord.id))
        .where(EstimateRecord.camera_id == CameraRecord.id)
        .correlate(CameraRecord)
        .scalar_subquery()
    )
    query = select(EstimateRecord).join(CameraRecord, EstimateRecord.id == newest)
    records = session.scalars(query.options(defer(EstimateRecord.raw)))
    return {record.camera_id: record for record in records}


def firing(session: Session) -> Sequence[AlertRecord]:
    """All alerts that fire, but for members of a group, which speaks for them."""
    return session.scalars(
        select(AlertRecord).where(AlertRecord.state == "firing", AlertRecord.group_id.is_(None))
    ).all()


def trainings_by_state(session: Session) -> dict[str, int]:
    """How many trainings are stored in each state."""
    rows = session.execute(
        select(TrainingRecord.state, func.count()).group_by(TrainingRecord.state)
    )
    return {state: count for state, count in rows}


def heartbeats(session: Session) -> dict[str, datetime]:
    """When each worker was last heard of."""
    rows = session.execute(select(WorkerRecord.name, WorkerRecord.heartbeat_at))
    return {name: at for name, at in rows}


def backlogs(session: Session) -> dict[str, Backlog]:
    """What waits for each webhook that something waits for."""
    rows = session.execute(
        select(DeliveryRecord.webhook_id, func.count(), func.min(DeliveryRecord.created_at))
        .where(DeliveryRecord.state == "pending")
        .group_by(DeliveryRecord.webhook_id)
    )
    return {name: Backlog(count=count, oldest_at=oldest) for name, count, oldest in rows}
