"""Open, update and end alerts; one is open for a camera and kind."""

import secrets
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.errors import ConflictError, NotFoundError
from service.recalibration.outbox import queue_alert
from service.store import alerts, events
from service.store.tables import AlertRecord


def open_alert(
    session: Session,
    camera_id: str,
    kind: str,
    severity: str,
    drift: dict[str, Any],
    changed_at: datetime | None,
    *,
    reason: str,
    source: str = "estimate",
) -> AlertRecord:
    """Open an alert, or bring the open one up to date.

    What a reference doubts does not overwrite what estimates have found; they take over its alert.
    """
    now = datetime.now(UTC)
    record = alerts.firing(session, camera_id, kind)
    if record is not None:
        if source == "reference":
            return record
        told_anew = record.severity != severity or record.source != source
        record.drift, record.severity, record.updated_at = drift, severity, now
        record.reason, record.source = reason, source
        record.changed_at = changed_at or record.changed_at
        if told_anew:
            _tell(session, record)
        return record
    record = AlertRecord(
        id=secrets.token_hex(16),
        camera_id=camera_id,
        kind=kind,
        state="firing",
        source=source,
        severity=severity,
        reason=reason,
        drift=drift,
        opened_at=now,
        changed_at=changed_at,
        updated_at=now,
    )
    session.add(record)
    session.flush()
    _tell(session, record)
    return record


def fired_by_estimate(session: Session, camera_id: str) -> set[str]:
    """The kinds of a camera's open alerts that its estimates stand behind."""
    found = (alerts.firing(session, camera_id, kind) for kind in alerts.POSE_KINDS)
    return {record.kind for record in found if record and record.source == "estimate"}


def end_alert(
    session: Session, camera_id: str, kind: str, outcome: str, note: str | None = None
) -> None:
    """End the open alert of a camera and kind, if there is one."""
    record = alerts.firing(session, camera_id, kind)
    if record is not None:
        _end(session, record, outcome, note, None)


def close_pose_alerts(session: Session, camera_id: str, outcome: str, by: str | None) -> None:
    """End the open alerts that measure a camera against its prior pose, if there are any."""
    for kind in alerts.POSE_KINDS:
        record = alerts.firing(session, camera_id, kind)
        if record is not None:
            _end(session, record, outcome, None, by)


def list_alerts(
    session: Session, state: str | None, camera_id: str | None, limit: int
) -> Sequence[AlertRecord]:
    """Alerts, newest first."""
    return alerts.listed(session, state, camera_id, limit)


def show_alert(session: Session, alert_id: str) -> AlertRecord:
    """An alert.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = alerts.find(session, alert_id)
    if record is None:
        raise NotFoundError(f"alert_id: there is no alert {alert_id!r}")
    return record


def acknowledge_alert(session: Session, alert_id: str, by: str | None) -> AlertRecord:
    """Note who has seen an alert; the first one stays.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is resolved.
    """
    record = _require_firing(session, alert_id)
    if record.acknowledged_at is None:
        record.acknowledged_by = by or "someone"
        record.acknowledged_at = datetime.now(UTC)
        _tell(session, record)
    return record


def resolve_alert(
    session: Session, alert_id: str, outcome: str, note: str | None, by: str | None
) -> AlertRecord:
    """End an alert with what came of it; an alert of the same kind may open anew later.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is resolved.
    """
    record = _require_firing(session, alert_id)
    _end(session, record, outcome, note, by)
    return record


def _require_firing(session: Session, alert_id: str) -> AlertRecord:
    record = show_alert(session, alert_id)
    if record.state != "firing":
        raise ConflictError(f"state: only a firing alert takes this, it is {record.state}")
    return record


def _end(
    session: Session, record: AlertRecord, outcome: str, note: str | None, by: str | None
) -> None:
    now = datetime.now(UTC)
    record.state, record.outcome, record.note, record.resolved_by = "resolved", outcome, note, by
    record.resolved_at = record.updated_at = now
    _tell(session, record)


def _tell(session: Session, record: AlertRecord, change: str | None = None) -> None:
    """Tell of a change: opened, updated, acknowledged, silenced, resolved; None: by its times."""
    payload = {
        "id": record.id,
        "camera_id": record.camera_id,
        "kind": record.kind,
        "state": record.state,
        "severity": record.severity,
        "reason": record.reason,
        "drift": record.drift,
        "outcome": record.outcome,
        "acknowledged_by": record.acknowledged_by,
    }
    events.add(session, "alert", payload, datetime.now(UTC))
    queue_alert(session, record, change)
