"""Alerts."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import (
    JSON,
    ColumnElement,
    Index,
    Select,
    String,
    and_,
    bindparam,
    exists,
    func,
    not_,
    or_,
    select,
    text,
)
from sqlalchemy.orm import Mapped, Session, aliased, defer, mapped_column

from service.enums import Activity, AlertKind, AlertSource, AlertState, Answer, Outcome, Severity
from service.reasons import Reasons, code_of, values_of
from service.store.journal import ActivityRecord
from service.store.record import (
    Record,
    camera_key,
    delete_some,
    foreign_key,
    newest_first,
)
from service.store.sources import Poster

_IS_FIRING = f"state = '{AlertState.FIRING}'"


class AlertRecord(Record):
    """An alert; at most one of a camera and kind is firing.

    `evidence` is what an estimate was by that fired it or kept it so: statistics, and no people.
    `source` is the part of the service that opened it: an estimate, which also ends it, the
    reference, the camera's rhythm, the upkeep, or a group. A group's alert has `camera_ids` instead
    of a camera, and its members have its id as `group_id`. `track_source` and `poster_id` identify
    the poster (`sources.Poster`); at most one group of a poster and kind is firing. `notified` is
    true once an event was sent for this alert by itself.
    """

    __tablename__ = "alerts"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str | None] = camera_key()
    camera_ids: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))
    group_id: Mapped[str | None] = foreign_key("alerts.id", "SET NULL", index=True)
    track_source: Mapped[str | None]
    kind: Mapped[AlertKind]
    state: Mapped[AlertState]
    source: Mapped[AlertSource]
    notified: Mapped[bool] = mapped_column("told", default=False)
    severity: Mapped[Severity]
    reasons: Mapped[Reasons]
    drift: Mapped[dict[str, Any]]
    evidence: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    opened_at: Mapped[datetime]
    changed_after: Mapped[datetime | None]
    changed_at: Mapped[datetime | None]
    updated_at: Mapped[datetime]
    acknowledged_by: Mapped[str | None]
    acknowledged_at: Mapped[datetime | None]
    escalated_at: Mapped[datetime | None]
    silenced_until: Mapped[datetime | None]
    silence_reason: Mapped[str | None]
    silenced_by: Mapped[str | None]
    resolved_at: Mapped[datetime | None]
    resolved_by: Mapped[str | None]
    outcome: Mapped[Outcome | None]
    note: Mapped[str | None]
    poster_id: Mapped[str] = mapped_column(String(16), default="")

    __table_args__ = (
        Index(
            "uq_alerts_firing",
            "camera_id",
            "kind",
            unique=True,
            sqlite_where=text(_IS_FIRING),
            postgresql_where=text(_IS_FIRING),
        ),
        Index(
            "uq_alerts_firing_group",
            "track_source",
            "poster_id",
            "kind",
            unique=True,
            sqlite_where=text(f"{_IS_FIRING} AND camera_id IS NULL"),
            postgresql_where=text(f"{_IS_FIRING} AND camera_id IS NULL"),
        ),
        Index(None, "opened_at"),
        Index(None, "camera_id", "opened_at"),
    )

    @property
    def reason_code(self) -> str | None:
        """The code of the first reason; None of a group that is about to be told."""
        return code_of(self.reasons)

    @property
    def reason_values(self) -> dict[str, Any]:
        """The numbers and names of the first reason, angles in degrees."""
        return values_of(self.reasons)

    def is_silenced(self, now: datetime) -> bool:
        """Whether it is to be quiet."""
        return self.silenced_until is not None and self.silenced_until > now


SCALE_KINDS = (AlertKind.CLOCK, AlertKind.LENS)  # that look like a move of a camera that stands
MOVED_KINDS = (AlertKind.DRIFT, *SCALE_KINDS)
POSE_KINDS = (*MOVED_KINDS, AlertKind.UNSURE)  # that hold a camera against its prior pose
# What came of an alert, of what a person may say of its kind; the first is that it was real.
_OF_POSE = (Answer.PUT_BACK, Answer.ACCEPTED, Answer.FALSE_ALARM)
_OF_OTHERS = (Answer.FIXED, Answer.FALSE_ALARM)
# By which a person says that a camera is at its prior pose, and its clock is right.
ANSWERS = (Outcome.PUT_BACK, Outcome.FIXED, Outcome.RELEARNED, Outcome.FALSE_ALARM)
# Of a group's kind, those of the alerts that it is made of.
MEMBER_KINDS = {
    AlertKind.MANY_MOVED: MOVED_KINDS,
    AlertKind.MANY_SILENT: (AlertKind.NO_DATA,),
}
MEMBER = "member"  # instead of its kind, of an alert that is answered with its group
# After these an alert waits for somebody as if it had just opened.
TOLD_ANEW = (Activity.ALERT_REOPENED, Activity.ALERT_GIVEN_BACK, Activity.ALERT_SILENCE_ENDED)
SERVICE_KINDS = (AlertKind.STALE,)  # about the service itself, whatever is done at the camera

# Built once: each reconcile of a camera asks for it.
_FIRING = select(AlertRecord).where(
    AlertRecord.camera_id == bindparam("camera"),
    AlertRecord.kind == bindparam("kind"),
    AlertRecord.state == AlertState.FIRING,
)

_ABOUT_POSE = select(AlertRecord.kind).where(
    AlertRecord.camera_id == bindparam("camera"),
    AlertRecord.kind.in_(POSE_KINDS),
    AlertRecord.state == AlertState.FIRING,
)
_BY_ESTIMATES = _ABOUT_POSE.where(AlertRecord.source == AlertSource.ESTIMATE)


def answers_of(kind: AlertKind) -> tuple[Answer, ...]:
    """What a person may say came of an alert: of a clock or a tracker no pose can be accepted."""
    return _OF_POSE if kind in (AlertKind.DRIFT, AlertKind.UNSURE) else _OF_OTHERS


def told_by(kind: AlertKind) -> set[AlertKind]:
    """Kinds: who hears of any of them hears of alerts of this one; a group speaks for some."""
    return {kind, *MEMBER_KINDS.get(kind, ())}


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertFilter:
    """A choice of alerts; None is any. `before` is the last one of the page before."""

    state: AlertState | None = None
    kinds: Collection[AlertKind] | None = None
    severity: Severity | None = None
    camera_id: str | None = None
    group_id: str | None = None
    opened_from: datetime | None = None
    opened_to: datetime | None = None
    open_since: datetime | None = None
    before: tuple[datetime, str] | None = None
    acknowledged: bool | None = None
    silenced: bool | None = None


def firing(session: Session, camera_id: str, kind: AlertKind) -> AlertRecord | None:
    """The open alert of a camera and kind, or None."""
    return session.scalars(_FIRING, {"camera": camera_id, "kind": kind}).first()


def pose_doubted(session: Session, camera_id: str) -> bool:
    """True while an open alert holds a camera against its prior pose."""
    return session.scalars(_ABOUT_POSE, {"camera": camera_id}).first() is not None


def firing_by_estimates(session: Session, camera_id: str) -> set[AlertKind]:
    """The kinds of a camera's open alerts that its estimates stand behind."""
    return set(session.scalars(_BY_ESTIMATES, {"camera": camera_id}))


def firing_codes(session: Session, kind: AlertKind) -> dict[str, str | None]:
    """The codes of the open alerts of a kind, by the cameras that they are about."""
    found = session.scalars(_all_firing(AlertRecord.kind == kind))
    return {
        record.camera_id: code_of(record.reasons)
        for record in found
        if record.camera_id is not None
    }


def newest(session: Session, camera_id: str, kind: AlertKind) -> AlertRecord | None:
    """The alert of a camera and kind that was opened last, or None."""
    query = newest_first(AlertRecord, camera_id, AlertRecord.opened_at)
    return session.scalars(query.where(AlertRecord.kind == kind).limit(1)).first()


def drift_at(session: Session, camera_id: str, at: datetime) -> AlertRecord | None:
    """The alert by which a camera had moved at a time, as estimates found; the last of several."""
    begun = func.coalesce(AlertRecord.changed_at, AlertRecord.opened_at)
    query = select(AlertRecord).where(
        AlertRecord.camera_id == camera_id,
        AlertRecord.kind == AlertKind.DRIFT,
        AlertRecord.source == AlertSource.ESTIMATE,
        begun <= at,
        or_(AlertRecord.resolved_at.is_(None), AlertRecord.resolved_at > at),
        or_(AlertRecord.outcome.is_(None), AlertRecord.outcome != Outcome.FALSE_ALARM),
    )
    return session.scalars(query.order_by(begun.desc()).limit(1)).first()


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


def firing_of_poster(
    session: Session, poster: Poster, kinds: Sequence[AlertKind]
) -> Sequence[AlertRecord]:
    """Return the open alerts of some kinds about the cameras of a poster."""
    query = _all_firing(*_of_poster(poster), AlertRecord.kind.in_(kinds))
    return session.scalars(query.where(AlertRecord.camera_id.is_not(None))).all()


def firing_group(session: Session, poster: Poster, kind: AlertKind) -> AlertRecord | None:
    """Return the open group alert of a poster, or None."""
    query = _all_firing(*_of_poster(poster), AlertRecord.kind == kind)
    return session.scalars(query.where(AlertRecord.camera_id.is_(None))).first()


def newest_group(session: Session, poster: Poster, kind: AlertKind) -> AlertRecord | None:
    """Return the group alert of a poster that was opened last, or None."""
    query = select(AlertRecord).where(
        *_of_poster(poster), AlertRecord.camera_id.is_(None), AlertRecord.kind == kind
    )
    return session.scalars(query.order_by(AlertRecord.opened_at.desc()).limit(1)).first()


def group_ended_at(session: Session, poster: Poster, kind: AlertKind) -> datetime | None:
    """Return when the last group alert of a poster ended, or None."""
    query = select(func.max(AlertRecord.resolved_at)).where(
        *_of_poster(poster), AlertRecord.kind == kind, AlertRecord.camera_id.is_(None)
    )
    return session.scalar(query)


def _of_poster(poster: Poster) -> tuple[ColumnElement[bool], ...]:
    same_source = AlertRecord.track_source == poster.source
    return same_source, AlertRecord.poster_id == poster.token_id


def firing_members(session: Session, group_id: str) -> Sequence[AlertRecord]:
    """The open alerts that a group is made of."""
    query = _all_firing(AlertRecord.group_id == group_id)
    return session.scalars(query.order_by(AlertRecord.camera_id)).all()


def outcomes_of(session: Session, group_id: str) -> Sequence[Outcome]:
    """What came of the alerts that a group is made of, as far as they have ended."""
    query = select(AlertRecord.outcome).where(AlertRecord.group_id == group_id)
    return [outcome for outcome in session.scalars(query) if outcome is not None]


def groups_without_members(session: Session) -> Sequence[AlertRecord]:
    """Open groups none of whose members is: their cameras are gone."""
    member = aliased(AlertRecord)
    of_group = exists().where(member.group_id == AlertRecord.id, member.state == AlertState.FIRING)
    groups = AlertRecord.camera_id.is_(None), AlertRecord.kind.in_(MEMBER_KINDS)
    return session.scalars(_all_firing(*groups, ~of_group)).all()


def silences_over(session: Session, now: datetime) -> Sequence[AlertRecord]:
    """Open alerts whose silence has come to its time."""
    return session.scalars(_all_firing(AlertRecord.silenced_until <= now)).all()


def unheeded(session: Session, since: datetime, now: datetime) -> Sequence[AlertRecord]:
    """Open alerts that nobody has taken up since a time, told of last before it, and once yet."""
    told_anew = exists().where(
        ActivityRecord.subject_id == AlertRecord.id,
        ActivityRecord.what.in_(TOLD_ANEW),
        ActivityRecord.at > since,
        ActivityRecord.at <= now,  # not of before the clock was set back
    )
    return session.scalars(
        _waiting(now).where(
            AlertRecord.escalated_at.is_(None), AlertRecord.opened_at <= since, ~told_anew
        )
    ).all()


def unmailed(session: Session, now: datetime) -> Sequence[AlertRecord]:
    """Open alerts that were escalated, wait still, and of which no mail has told yet."""
    mailed = exists().where(
        ActivityRecord.subject_id == AlertRecord.id,
        ActivityRecord.what == Activity.ALERT_MAILED,
        ActivityRecord.at >= AlertRecord.escalated_at,
    )
    query = _waiting(now).where(AlertRecord.escalated_at.is_not(None), ~mailed)
    return session.scalars(query.order_by(AlertRecord.opened_at)).all()


def _all_firing(*conditions: ColumnElement[bool]) -> Select[AlertRecord]:
    return select(AlertRecord).where(AlertRecord.state == AlertState.FIRING, *conditions)


def answered_at(session: Session, camera_id: str) -> datetime | None:
    """The time at which a person last said that the camera is where it should be."""
    return session.scalar(
        select(AlertRecord.resolved_at)
        .where(
            AlertRecord.camera_id == camera_id,
            AlertRecord.kind.in_(POSE_KINDS),
            AlertRecord.outcome.in_(ANSWERS),
        )
        .order_by(AlertRecord.resolved_at.desc())
        .limit(1)
    )


def listed(
    session: Session, wanted: AlertFilter, now: datetime, limit: int, *, lean: bool = False
) -> Sequence[AlertRecord]:
    """Alerts, newest first; without what each is by, which is most of it, where that is `lean`."""
    named = ("state", "severity", "camera_id", "group_id")
    chosen = {name: getattr(wanted, name) for name in named if getattr(wanted, name) is not None}
    query = select(AlertRecord).filter_by(**chosen)
    if wanted.kinds is not None:
        query = query.where(AlertRecord.kind.in_(wanted.kinds))
    if wanted.opened_from is not None:
        query = query.where(AlertRecord.opened_at >= wanted.opened_from)
    if wanted.opened_to is not None:
        query = query.where(AlertRecord.opened_at < wanted.opened_to)
    if wanted.open_since is not None:
        ended_at = AlertRecord.resolved_at
        query = query.where(or_(ended_at.is_(None), ended_at >= wanted.open_since))
    if wanted.before is not None:
        opened_at, alert_id = wanted.before
        query = query.where(
            or_(
                AlertRecord.opened_at < opened_at,
                and_(AlertRecord.opened_at == opened_at, AlertRecord.id < alert_id),
            )
        )
    if wanted.acknowledged is not None:
        seen = AlertRecord.acknowledged_at.is_not(None)
        query = query.where(seen if wanted.acknowledged else not_(seen))
    if wanted.silenced is not None:
        until = AlertRecord.silenced_until
        silent = and_(until.is_not(None), until > now)
        query = query.where(silent if wanted.silenced else not_(silent))
    if lean:
        query = query.options(defer(AlertRecord.evidence))
    order = AlertRecord.opened_at.desc(), AlertRecord.id.desc()
    return session.scalars(query.order_by(*order).limit(limit)).all()


def count_waiting(session: Session, now: datetime) -> int:
    """Open alerts that nobody has taken up; a group counts for its members."""
    return session.scalar(select(func.count()).select_from(_waiting(now).subquery())) or 0


def _waiting(now: datetime) -> Select[AlertRecord]:
    quiet = and_(AlertRecord.silenced_until.is_not(None), AlertRecord.silenced_until > now)
    return _all_firing(
        AlertRecord.acknowledged_at.is_(None), not_(quiet), AlertRecord.group_id.is_(None)
    )


def forget(session: Session, before: datetime, limit: int) -> int:
    """Delete up to `limit` alerts that ended before a time. Returns how many."""
    bite = (
        select(AlertRecord.id)
        .where(AlertRecord.state == AlertState.RESOLVED, AlertRecord.resolved_at < before)
        .limit(limit)
    )
    return delete_some(session, AlertRecord.id, bite)
