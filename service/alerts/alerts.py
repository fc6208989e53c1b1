"""Open, update and end alerts; one is open for a camera and kind, or for a group."""

import secrets
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.access.activity import note as note_activity
from service.alerts.groups import group_with, new_group
from service.enums import (
    Activity,
    AlertActivity,
    AlertKind,
    AlertSource,
    AlertState,
    EventType,
    MessageType,
    Outcome,
    Severity,
)
from service.errors import ConflictError, NotFoundError
from service.notifications.outbox import alert_body, queue_alert
from service.reasons import Reasons
from service.settings import Settings
from service.store import alerts, journal, references, sources
from service.store.alerts import AlertFilter, AlertRecord
from service.store.journal import ActivityRecord
from service.store.sources import Poster
from service.wording.reasons import in_words

# What of an alert's body an event has.
_EVENT_FIELDS = (
    *("id", "camera_id", "kind", "state", "severity", "reason", "reason_code", "reason_values"),
    *("drift", "outcome", "acknowledged_by", "silenced_until", "silence_reason", "silenced_by"),
    *("track_source", "camera_ids", "group_id"),
)
# What messages say of an activity; that an alert grew is told with what made it grow.
_NOTIFIED_AS = {
    AlertActivity.OPENED: MessageType.ALERT_OPENED,
    AlertActivity.ESCALATED: MessageType.ALERT_ESCALATED,
    AlertActivity.ACKNOWLEDGED: MessageType.ALERT_ACKNOWLEDGED,
    AlertActivity.GIVEN_BACK: MessageType.ALERT_UPDATED,
    AlertActivity.SILENCED: MessageType.ALERT_SILENCED,
    AlertActivity.SILENCE_ENDED: MessageType.ALERT_UPDATED,
    AlertActivity.RESOLVED: MessageType.ALERT_RESOLVED,
    AlertActivity.REOPENED: MessageType.ALERT_OPENED,
}


def open_alert(
    session: Session,
    settings: Settings,
    camera_id: str,
    kind: AlertKind,
    severity: Severity,
    drift: dict[str, Any],
    changed_at: datetime | None,
    *,
    reasons: Reasons,
    changed_after: datetime | None = None,
    evidence: dict[str, Any] | None = None,
    source: AlertSource = AlertSource.ESTIMATE,
) -> AlertRecord | None:
    """Open an alert, or bring the open one up to date; None where somebody is at the camera.

    What a reference doubts does not overwrite what estimates have found; they take over its alert.
    """
    now = datetime.now(UTC)
    attended = references.maintenance_under_way(session, camera_id, now) is not None
    if attended and kind not in alerts.SERVICE_KINDS:
        return None  # an open one stays as it was told, so that what is news later is told then
    record = alerts.firing(session, camera_id, kind)
    if record is not None and source == AlertSource.REFERENCE:
        return record
    change: MessageType | None = MessageType.ALERT_OPENED
    if record is not None:
        changed = (record.severity, record.source) != (severity, source)
        change = MessageType.ALERT_UPDATED if changed else None
        if (record.severity, severity) == (Severity.WARNING, Severity.CRITICAL):
            _keep_activity(session, record, AlertActivity.GREW, None)
        record.changed_at = changed_at or record.changed_at
        record.changed_after = changed_after or record.changed_after
    else:
        poster = sources.poster_of(session, camera_id)
        record = AlertRecord(
            id=secrets.token_hex(16),
            camera_id=camera_id,
            track_source=None if poster is None else poster.source,
            poster_id="" if poster is None else poster.token_id,
            kind=kind,
            state=AlertState.FIRING,
            notified=False,
            opened_at=now,
            changed_after=changed_after,
            changed_at=changed_at,
        )
    record.severity, record.source = severity, source
    record.drift, record.reasons, record.updated_at = drift, reasons, now
    record.evidence = evidence
    if change == MessageType.ALERT_OPENED:
        session.add(record)
        session.flush()
        _keep_activity(session, record, AlertActivity.OPENED, None)
    group = group_with(session, settings, record)
    if group is not None:
        _keep_activity(session, group, AlertActivity.OPENED, None)
        _tell(session, group, MessageType.ALERT_OPENED)
    if change is not None:
        _tell(session, record, change)
    return record


def open_group_alert(
    session: Session,
    poster: Poster,
    kind: AlertKind,
    *,
    camera_ids: Sequence[str],
    reasons: Reasons,
    source: AlertSource,
) -> AlertRecord:
    """Open an alert about several cameras of one poster; it has no alerts as members."""
    record = new_group(session, poster, kind, source, camera_ids, reasons)
    _keep_activity(session, record, AlertActivity.OPENED, None)
    _tell(session, record, MessageType.ALERT_OPENED)
    return record


def end_alert(
    session: Session, camera_id: str, kind: AlertKind, outcome: Outcome, note: str | None = None
) -> None:
    """End the open alert of a camera and kind, if there is one."""
    record = alerts.firing(session, camera_id, kind)
    if record is not None:
        close_alert(session, record, outcome, note)


def close_pose_alerts(
    session: Session, camera_id: str, outcome: Outcome, by: str | None, note: str | None = None
) -> None:
    """End the open alerts that measure a camera against its prior pose, if there are any.

    Clock and lens are neither put back nor accepted: their alert is mended with the pose.
    """
    for kind in alerts.POSE_KINDS:
        record = alerts.firing(session, camera_id, kind)
        if record is not None:
            fixed = outcome in (Outcome.PUT_BACK, Outcome.ACCEPTED) and kind in alerts.SCALE_KINDS
            close_alert(session, record, Outcome.FIXED if fixed else outcome, note, by)


def close_alert(
    session: Session,
    record: AlertRecord,
    outcome: Outcome,
    note: str | None = None,
    by: str | None = None,
) -> None:
    """End an open alert with what came of it; with the last of a group, that too."""
    now = datetime.now(UTC)
    record.state, record.outcome = AlertState.RESOLVED, outcome
    record.note, record.resolved_by = note, by
    record.resolved_at = record.updated_at = now
    _keep_activity(session, record, AlertActivity.RESOLVED, by, outcome=outcome, note=note)
    session.flush()
    _tell(session, record, MessageType.ALERT_RESOLVED)
    group = None if record.group_id is None else session.get(AlertRecord, record.group_id)
    over = group is not None and not alerts.firing_members(session, group.id)
    if group is not None and group.state == AlertState.FIRING and over:
        came = Counter(alerts.outcomes_of(session, group.id))
        # That of most members; of as many, the last one's.
        of_most = max(came, key=lambda each: (came[each], each == outcome))
        close_alert(session, group, of_most, note, by)


def leave_group(session: Session, record: AlertRecord) -> None:
    """Take a firing alert out of its group, and notify of it if nothing has yet."""
    record.group_id = None
    session.flush()
    if not record.notified:
        _tell(session, record, MessageType.ALERT_OPENED)


def reopen_alert(session: Session, record: AlertRecord, by: str | None) -> None:
    """Have an alert fire on that was ended in error; one of a group that has ended, by itself."""
    group = None if record.group_id is None else session.get(AlertRecord, record.group_id)
    if group is not None and group.state != AlertState.FIRING:
        record.group_id = None
    record.state, record.outcome = AlertState.FIRING, None
    record.note = record.resolved_by = record.resolved_at = record.escalated_at = None
    note_on_alert(session, record, AlertActivity.REOPENED, by)


def end_empty_groups(session: Session) -> None:
    """End groups whose members are gone with their cameras."""
    for group in alerts.groups_without_members(session):
        close_alert(session, group, Outcome.CLEARED)


def list_alerts(session: Session, wanted: AlertFilter, limit: int) -> Sequence[AlertRecord]:
    """Alerts, newest first."""
    return alerts.listed(session, wanted, datetime.now(UTC), limit)


def show_alert(session: Session, alert_id: str) -> AlertRecord:
    """An alert.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = session.get(AlertRecord, alert_id)
    if record is None:
        raise NotFoundError(f"alert_id: there is no alert {alert_id!r}")
    return record


def evidence_of_alert(session: Session, alert_id: str) -> dict[str, Any]:
    """What an estimate was by that stands behind an alert; angles in radians.

    Raises:
        NotFoundError: there is no such alert, or no estimate stands behind it.
    """
    record = show_alert(session, alert_id)
    if record.evidence is None:
        raise NotFoundError(
            f"alert_id: {record.kind} is not told by an estimate, it has no evidence"
        )
    return record.evidence


def activity_of_alert(session: Session, alert_id: str) -> Sequence[ActivityRecord]:
    """Everything that was done with an alert since it opened, oldest first."""
    entries = journal.activity_of_subject(session, alert_id)
    return [entry for entry in entries if entry.what != Activity.ALERT_OPENED]


def acknowledge_alert(
    session: Session, alert_id: str, by: str | None, *, acknowledged: bool = True
) -> AlertRecord:
    """Note who has seen an alert, the first one stays; else it waits for a person again.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is resolved.
    """
    record = require_firing(session, alert_id)
    if acknowledged == (record.acknowledged_at is not None):
        return record
    if acknowledged:
        record.acknowledged_by = by or "someone"
        record.acknowledged_at = datetime.now(UTC)
        note_on_alert(session, record, AlertActivity.ACKNOWLEDGED, record.acknowledged_by)
    else:
        record.acknowledged_by = record.acknowledged_at = record.escalated_at = None
        note_on_alert(session, record, AlertActivity.GIVEN_BACK, by)
    return record


def require_firing(session: Session, alert_id: str) -> AlertRecord:
    """An open alert.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it is resolved.
    """
    record = show_alert(session, alert_id)
    if record.state != AlertState.FIRING:
        raise ConflictError(f"state: only a firing alert takes this, it is {record.state}")
    return record


def note_on_alert(
    session: Session,
    record: AlertRecord,
    what: AlertActivity,
    by: str | None,
    *,
    until: datetime | None = None,
    note: str | None = None,
) -> None:
    """Keep what was done with an open alert, and tell of it."""
    record.updated_at = datetime.now(UTC)
    _keep_activity(session, record, what, by, until=until, note=note)
    _tell(session, record, _NOTIFIED_AS[what])


def _keep_activity(
    session: Session,
    record: AlertRecord,
    what: AlertActivity,
    by: str | None,
    *,
    until: datetime | None = None,
    outcome: Outcome | None = None,
    note: str | None = None,
) -> None:
    note_activity(
        session,
        Activity(f"alert.{what}"),
        by=by,
        camera_id=record.camera_id,
        subject_id=record.id,
        kind=record.kind,
        until=until,
        outcome=outcome,
        text=note,
        details={
            "severity": record.severity,
            "reason": in_words(record.reasons),
            "reason_code": record.reason_code,
        },
    )


def _tell(session: Session, record: AlertRecord, message: MessageType) -> None:
    """Tell of a change to an alert."""
    # A group speaks for its members; the end of one that was told by itself is told so, too.
    if record.group_id is not None and not (
        record.notified and record.state == AlertState.RESOLVED
    ):
        return
    record.notified = True
    body = alert_body(record)
    event = {name: body[name] for name in _EVENT_FIELDS} | {"message": message}
    journal.add_event(session, EventType.ALERT, event, datetime.now(UTC))
    queue_alert(session, record, body, message)
