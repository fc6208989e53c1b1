"""Statements on what was done with alerts."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.alert_tables import AlertActRecord


def add(session: Session, record: AlertActRecord) -> None:
    """Keep an act."""
    session.add(record)


def of_alerts(session: Session, alert_ids: Sequence[str]) -> Sequence[AlertActRecord]:
    """What was done with some alerts, oldest first."""
    return session.scalars(
        select(AlertActRecord)
        .where(AlertActRecord.alert_id.in_(alert_ids))
        .order_by(AlertActRecord.id)
    ).all()


def of_alert(session: Session, alert_id: str) -> Sequence[AlertActRecord]:
    """What was done with an alert, oldest first."""
    return session.scalars(
        select(AlertActRecord)
        .where(AlertActRecord.alert_id == alert_id)
        .order_by(AlertActRecord.id)
    ).all()
