"""Statements on alerts."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.tables import AlertRecord

POSE_KINDS = ("drift", "clock", "out_of_range")  # that hold a camera against its prior pose


def find(session: Session, alert_id: str) -> AlertRecord | None:
    """The alert, or None."""
    return session.get(AlertRecord, alert_id)


def firing(session: Session, camera_id: str, kind: str) -> AlertRecord | None:
    """The open alert of a camera and kind, or None."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind == kind,
            AlertRecord.state == "firing",
        )
    ).first()


def ended(session: Session, camera_id: str) -> Sequence[AlertRecord]:
    """The alerts about a camera's pose that have ended."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind.in_(POSE_KINDS),
            AlertRecord.resolved_at.is_not(None),
        )
    ).all()


def answered_at(session: Session, camera_id: str) -> datetime | None:
    """When a person last said of an alert that the camera is where it should be."""
    return session.scalar(
        select(AlertRecord.resolved_at)
        .where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind.in_(POSE_KINDS),
            AlertRecord.outcome.in_(("put_back", "false_alarm")),
        )
        .order_by(AlertRecord.resolved_at.desc())
        .limit(1)
    )


def listed(
    session: Session, state: str | None, camera_id: str | None, limit: int
) -> Sequence[AlertRecord]:
    """Alerts, newest first."""
    query = select(AlertRecord)
    if state is not None:
        query = query.where(AlertRecord.state == state)
    if camera_id is not None:
        query = query.where(AlertRecord.camera_id == camera_id)
    return session.scalars(query.order_by(AlertRecord.opened_at.desc()).limit(limit)).all()
