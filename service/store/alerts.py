"""Statements on alerts."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import and_, bindparam, exists, not_, select
from sqlalchemy.orm import Session, aliased

from service.enums import AlertKind, AlertState, Outcome
from service.store.database.deleting import delete_some
from service.store.tables.alerts import AlertRecord

POSE_KINDS = (AlertKind.DRIFT, AlertKind.CLOCK)  # that hold a camera against its prior pose
SERVICE_KINDS = (AlertKind.STALE,)  # about the service itself, whatever is done at the camera

# Built once: each reconcile of a camera asks for it.
_FIRING = select(AlertRecord).where(
    AlertRecord.camera_id == bindparam("camera"),
    AlertRecord.kind == bindparam("kind"),
    AlertRecord.state == AlertState.FIRING,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertFilter:
    """Which alerts are wanted; None is any."""

    state: AlertState | None = None
    camera_id: str | None = None
    group_id: str | None = None
    acknowledged: bool | None = None
    silenced: bool | None = None


def find(session: Session, alert_id: str) -> AlertRecord | None:
    """The alert, or None."""
    return session.get(AlertRecord, alert_id)


def firing(session: Session, camera_id: str, kind: AlertKind) -> AlertRecord | None:
    """The open alert of a camera and kind, or None."""
    return session.scalars(_FIRING, {"camera": camera_id, "kind": kind}).first()


def firing_cameras(session: Session, kind: AlertKind) -> set[str]:
    """The cameras about which an alert of a kind is open."""
    return set(
        session.scalars(
            select(AlertRecord.camera_id).where(
                AlertRecord.kind == kind,
                AlertRecord.state == AlertState.FIRING,
                AlertRecord.camera_id.is_not(None),
            )
        )
    )


def newest(session: Session, camera_id: str, kind: AlertKind) -> AlertRecord | None:
    """The alert of a camera and kind that was opened last, or None."""
    return session.scalars(
        select(AlertRecord)
        .where(AlertRecord.camera_id == camera_id, AlertRecord.kind == kind)
        .order_by(AlertRecord.opened_at.desc())
        .limit(1)
    ).first()


def ended(
    session: Session, camera_id: str, kinds: Sequence[AlertKind] = POSE_KINDS
) -> Sequence[AlertRecord]:
    """The alerts of a camera and some kinds that have ended; those about its pose, if unsaid."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind.in_(kinds),
            AlertRecord.resolved_at.is_not(None),
        )
    ).all()


def firing_of_source(
    session: Session, track_source: str, kinds: Sequence[AlertKind]
) -> Sequence[AlertRecord]:
    """The open alerts of some kinds about the cameras of a source of tracks."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.track_source == track_source,
            AlertRecord.kind.in_(kinds),
            AlertRecord.state == AlertState.FIRING,
            AlertRecord.camera_id.is_not(None),
        )
    ).all()


def firing_group(session: Session, track_source: str, kind: AlertKind) -> AlertRecord | None:
    """The open alert about all of a source of tracks, or None."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.track_source == track_source,
            AlertRecord.kind == kind,
            AlertRecord.state == AlertState.FIRING,
            AlertRecord.camera_id.is_(None),
        )
    ).first()


def firing_members(session: Session, group_id: str) -> Sequence[AlertRecord]:
    """The open alerts that a group is made of."""
    return session.scalars(
        select(AlertRecord)
        .where(AlertRecord.group_id == group_id, AlertRecord.state == AlertState.FIRING)
        .order_by(AlertRecord.camera_id)
    ).all()


def groups_without_members(session: Session) -> Sequence[AlertRecord]:
    """Open groups none of whose members is: their cameras are gone."""
    member = aliased(AlertRecord)
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.camera_id.is_(None),
            AlertRecord.state == AlertState.FIRING,
            ~exists().where(member.group_id == AlertRecord.id, member.state == AlertState.FIRING),
        )
    ).all()


def silences_over(session: Session, now: datetime) -> Sequence[AlertRecord]:
    """Open alerts whose silence has come to its time."""
    return session.scalars(
        select(AlertRecord).where(
            AlertRecord.state == AlertState.FIRING, AlertRecord.silenced_until <= now
        )
    ).all()


def answered_at(session: Session, camera_id: str) -> datetime | None:
    """When a person last said of an alert that the camera is where it should be."""
    return session.scalar(
        select(AlertRecord.resolved_at)
        .where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind.in_(POSE_KINDS),
            AlertRecord.outcome.in_((Outcome.PUT_BACK, Outcome.FALSE_ALARM)),
        )
        .order_by(AlertRecord.resolved_at.desc())
        .limit(1)
    )


def listed(
    session: Session, wanted: AlertFilter, now: datetime, limit: int
) -> Sequence[AlertRecord]:
    """Alerts, newest first."""
    query = select(AlertRecord)
    if wanted.state is not None:
        query = query.where(AlertRecord.state == wanted.state)
    if wanted.camera_id is not None:
        query = query.where(AlertRecord.camera_id == wanted.camera_id)
    if wanted.group_id is not None:
        query = query.where(AlertRecord.group_id == wanted.group_id)
    if wanted.acknowledged is not None:
        seen = AlertRecord.acknowledged_at.is_not(None)
        query = query.where(seen if wanted.acknowledged else not_(seen))
    if wanted.silenced is not None:
        until = AlertRecord.silenced_until
        silent = and_(until.is_not(None), until > now)
        query = query.where(silent if wanted.silenced else not_(silent))
    return session.scalars(query.order_by(AlertRecord.opened_at.desc()).limit(limit)).all()


def forget(session: Session, before: datetime, limit: int) -> int:
    """Delete up to `limit` alerts that ended before a time. Returns how many."""
    bite = (
        select(AlertRecord.id)
        .where(AlertRecord.state == AlertState.RESOLVED, AlertRecord.resolved_at < before)
        .limit(limit)
    )
    return delete_some(session, AlertRecord.id, bite)
