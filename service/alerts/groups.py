"""Cameras of one poster that move together: one alert that names the tracker as the cause."""

import math
import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.reasons import Reason
from service.enums import AlertKind, AlertSource, AlertState, Severity
from service.reasons import Reasons, ServiceCode
from service.settings import Settings
from service.store import alerts, sources
from service.store.alerts import AlertRecord
from service.store.engines.store import also_about
from service.store.sources import Poster

_FED_WITHIN = timedelta(days=1)  # a camera without tracks for longer is no longer fed by its source


def group_with(session: Session, settings: Settings, record: AlertRecord) -> AlertRecord | None:
    """Put a camera's open alert into its group; return the group if it is new.

    A group has cameras of one poster: of one source name, posted by one token. Their alerts begin
    within `group_within_s` of each other, they are `group_cameras` or more, and at least
    `group_share` of the cameras that the poster feeds. Later alerts join without a notification.
    Alerts that an earlier group left open stay by themselves.
    """
    kind = next((kind for kind, kinds in alerts.MEMBER_KINDS.items() if record.kind in kinds), None)
    if kind is None or record.track_source is None or record.group_id is not None:
        return None
    poster = Poster(source=record.track_source, token_id=record.poster_id)
    # Cameras that move at the same moment see each other.
    also_about(session, f"source/{poster.source}")
    found = alerts.firing_of_poster(session, poster, alerts.MEMBER_KINDS[kind])
    ended_at = alerts.group_ended_at(session, poster, kind)
    if ended_at is not None:
        found = [each for each in found if each.group_id or each.opened_at > ended_at]
    together = _together(found, record, settings.group_within_s)
    group = alerts.firing_group(session, poster, kind)
    known = group is not None and any(member.group_id == group.id for member in together)
    if not known and not _enough(session, settings, poster, together):
        return None
    opened = group is None
    group = group or new_group(session, poster, kind, AlertSource.GROUP)
    for member in together:
        member.group_id = group.id
    members = {str(member.camera_id) for member in together}
    group.camera_ids = sorted({*(group.camera_ids or []), *members})
    began = [_began_at(member) for member in together]
    group.changed_at = min([*began, *([group.changed_at] if group.changed_at else [])])
    group.updated_at = datetime.now(UTC)
    group.reasons = (_reason(group),)
    session.flush()
    return group if opened else None


def new_group(
    session: Session,
    poster: Poster,
    kind: AlertKind,
    source: AlertSource,
    camera_ids: Sequence[str] = (),
    reasons: Reasons = (),
) -> AlertRecord:
    """Add a firing alert about several cameras of one poster."""
    now = datetime.now(UTC)
    group = AlertRecord(
        id=secrets.token_hex(16),
        camera_ids=list(camera_ids),
        track_source=poster.source,
        poster_id=poster.token_id,
        kind=kind,
        state=AlertState.FIRING,
        source=source,
        severity=Severity.CRITICAL,
        reasons=reasons,
        drift={},
        notified=False,
        opened_at=now,
        updated_at=now,
    )
    session.add(group)
    session.flush()
    return group


def _together(
    found: Sequence[AlertRecord], record: AlertRecord, within_s: float
) -> list[AlertRecord]:
    """Return the largest set of alerts, with this one, that begin within `within_s`."""
    at = _began_at(record)
    span = timedelta(seconds=within_s)
    best: list[AlertRecord] = []
    for first in found:
        begins = _began_at(first)
        if begins <= at <= begins + span:
            some = [alert for alert in found if begins <= _began_at(alert) <= begins + span]
            best = max(best, some, key=len)
    return best


def _enough(
    session: Session, settings: Settings, poster: Poster, together: Sequence[AlertRecord]
) -> bool:
    cameras = {alert.camera_id for alert in together}
    if len(cameras) < settings.group_cameras:
        return False
    fed = sources.cameras_fed_by(session, poster, datetime.now(UTC) - _FED_WITHIN)
    return len(cameras) >= math.ceil(settings.group_share * len(fed | cameras))


def _began_at(record: AlertRecord) -> datetime:
    return record.changed_at or record.opened_at


def _reason(group: AlertRecord) -> Reason:
    silent = group.kind == AlertKind.MANY_SILENT
    code = ServiceCode.FELL_SILENT_TOGETHER if silent else ServiceCode.MOVED_TOGETHER
    count, source = len(group.camera_ids or []), group.track_source or ""
    return Reason(code=code, values={"cameras": count, "track_source": source})
