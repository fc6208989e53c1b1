"""How a camera stands: the one derivation that pages, API, metrics and lists of alerts share.

While an alert that an estimate fired is open, the camera is taken for moved, whatever else is
known of it, and the last identifiable pose is served. Once a person has answered (it was put back,
it was a false alarm, its pose is accepted), nothing that was estimated before counts any more.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.alerts.arrival_models import ArrivalModel, unpacked
from service.alerts.data_gaps import is_no_data
from service.enums import AlertSource, Answer, Cause, Origin, PoseState, Severity
from service.notifications.outbox import is_silenced
from service.references import Attendance, attendance_by, made_against
from service.settings import Settings
from service.store import fleet, metrics
from service.store.alerts import POSE_KINDS, AlertRecord
from service.store.estimates import EstimateRecord
from service.store.maintenance import MaintenanceRecord
from service.store.references import SiteReferenceRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Clockwork:
    """All by which the clock alone, with nothing new in the store, changes how a camera stands.

    `moments` are when somebody comes to the camera or leaves it, and when an alert's silence ends.
    """

    settings: Settings
    rhythm: ArrivalModel | None
    last_track_s: float | None
    moments: tuple[datetime, ...]

    def silent(self, now: datetime) -> bool:
        """Whether nobody has been seen for longer than is usual; why says for how long, then."""
        return is_no_data(self.settings, self.rhythm, self.last_track_s, now)

    def hands(self, now: datetime) -> tuple[bool, ...]:
        """The same at two times between which nothing changes."""
        return (self.silent(now), *(at <= now for at in self.moments))


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFacts:
    """What is stored of a camera that its state follows from, at a moment.

    `estimate` is the newest, `last_identifiable` the newest of which something is identifiable.
    """

    reference: SiteReferenceRecord
    estimate: EstimateRecord | None
    last_identifiable: EstimateRecord | None
    attended: Attendance
    firing: Sequence[AlertRecord]
    clockwork: Clockwork


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """How a camera stands. `alerts` are all that fire, what needs a person most first.

    `estimate` is what is served, maybe nothing identifiable; None where the prior pose is. It is
    `judged` where it says how the camera stands now, against its reference; else it is the last
    that is known, or of a reference that is being learned. `cause` is what is waited after until
    then.
    """

    camera_id: str
    state: PoseState
    since: datetime
    reference: SiteReferenceRecord
    estimate: EstimateRecord | None
    judged: bool
    cause: Cause
    alerts: tuple[AlertRecord, ...]
    attended: Attendance
    silent: bool
    clockwork: Clockwork

    @property
    def last_track_s(self) -> float | None:
        """When the newest track ended of those that count."""
        return self.clockwork.last_track_s

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Those of tilt, roll, height, heading that are estimated."""
        return () if self.estimate is None else tuple(self.estimate.identifiable)


def standings(
    session: Session, settings: Settings, ids: Collection[str] | None = None
) -> dict[str, Standing]:
    """How all cameras stand, or some, in order of their ids: a handful of statements for all."""
    now = datetime.now(UTC)
    newest = metrics.newest(session, ids)
    windows: dict[str, list[MaintenanceRecord]] = {}
    if any(each.attended for each in newest.values()):
        windows = fleet.maintenance_windows(session, ids)
    firing: dict[str, list[AlertRecord]] = defaultdict(list)
    if any(each.fires for each in newest.values()):
        for alert in fleet.firing(session, ids):
            firing[str(alert.camera_id)].append(alert)
    without = [
        camera_id
        for camera_id, alerts in firing.items()
        if _holds(alerts) and camera_id in newest and not _identifies(newest[camera_id].estimate)
    ]
    before = metrics.newest_identifiable_estimates(session, without) if without else {}
    found = {}
    for camera_id, each in newest.items():
        attending = windows.get(camera_id, [])
        facts = CameraFacts(
            reference=each.reference,
            estimate=each.estimate,
            last_identifiable=before.get(camera_id) if camera_id in without else each.estimate,
            attended=attendance_by(attending, now),
            firing=firing[camera_id],
            clockwork=Clockwork(
                settings=settings,
                rhythm=None if each.rhythm is None else unpacked(each.rhythm),
                last_track_s=each.last_track_s,
                moments=tuple(_moments(attending, firing[camera_id])),
            ),
        )
        found[camera_id] = standing_of(facts, now)
    return found


def standing_of(facts: CameraFacts, now: datetime) -> Standing:
    """How a camera stands, by what is known of it."""
    reference = facts.reference
    estimate = _counting(facts, now)
    judged = estimate is not None and made_against(reference, estimate)
    alerts = tuple(sorted(facts.firing, key=lambda alert: _urgency(alert, now)))
    cause = _cause(reference, facts.attended, now)
    holding = _holds(alerts)
    silent = facts.clockwork.silent(now)
    state: PoseState
    if holding:
        estimate = estimate if judged else facts.last_identifiable
        state = PoseState.DRIFTING
    elif reference.ready_at is None or (not judged and cause != Cause.FALSE_ALARM):
        state = PoseState.LEARNING
    elif silent:
        state = PoseState.NO_DATA
    elif judged and estimate is not None:
        state = estimate.state
    else:
        state = PoseState.OK
    return Standing(
        camera_id=reference.camera_id,
        state=state,
        since=_since(state, facts, alerts, cause),
        reference=reference,
        estimate=estimate,
        judged=judged,
        cause=cause,
        alerts=alerts,
        attended=facts.attended,
        silent=silent,
        clockwork=facts.clockwork,
    )


def _identifies(estimate: EstimateRecord | None) -> bool:
    """Whether the newest estimate is the last that tells something; none is the last, too."""
    return estimate is None or bool(estimate.identifiable)


def _moments(
    windows: Sequence[MaintenanceRecord], firing: Sequence[AlertRecord]
) -> Iterator[datetime]:
    for window in windows:
        yield window.from_at
        yield window.until
    for alert in firing:
        if alert.silenced_until is not None:
            yield alert.silenced_until


def _holds(alerts: Sequence[AlertRecord]) -> list[AlertRecord]:
    """The alerts that say that a camera has moved, as estimates found."""
    return [
        each for each in alerts if each.kind in POSE_KINDS and each.source == AlertSource.ESTIMATE
    ]


def _counting(facts: CameraFacts, now: datetime) -> EstimateRecord | None:
    """The newest estimate; None where it says nothing of how the camera stands now."""
    reference, estimate = facts.reference, facts.estimate
    if estimate is None or estimate.reference_id != reference.id:
        return None  # it was measured against a pose or a reference that no longer counts
    if reference.answered_at is not None and estimate.created_at <= reference.answered_at:
        return None
    if reference.ready_at is None:
        return estimate
    # Somebody was at it and has gone: it may stand elsewhere. While they are there it is not
    # judged, so what was told before stands.
    begins_s = max(facts.attended.free_since_s(now) or 0.0, reference.window_from_s or 0.0)
    return estimate if estimate.to_s >= max(begins_s, reference.from_s or 0.0) else None


def _cause(reference: SiteReferenceRecord, attended: Attendance, now: datetime) -> Cause:
    """What was last of all that has the camera judged anew."""
    left_s = attended.free_since_s(now)
    if reference.answer is not None and reference.answered_at is not None:
        if left_s is not None and left_s > reference.answered_at.timestamp():
            return Cause.MAINTENANCE
        if reference.answer == Answer.FALSE_ALARM:
            return Cause.FALSE_ALARM
        return Cause.PUT_BACK
    if left_s is not None and left_s > max(reference.from_s or 0.0, reference.to_s or 0.0):
        return Cause.MAINTENANCE
    return Cause.PUT_BACK if reference.origin == Origin.PUT_BACK else Cause.REFERENCE


def _urgency(alert: AlertRecord, now: datetime) -> tuple[bool, bool, datetime]:
    return not waits(alert, now), alert.severity != Severity.CRITICAL, alert_since(alert)


def waits(alert: AlertRecord, now: datetime) -> bool:
    """Whether nobody has taken an alert up, and no group speaks for it."""
    return not (alert.acknowledged_by or is_silenced(alert, now) or alert.group_id is not None)


def alert_since(alert: AlertRecord) -> datetime:
    """Since when what an alert tells of is so, as far as is known."""
    return alert.changed_at or alert.opened_at


def _since(
    state: PoseState, facts: CameraFacts, alerts: Sequence[AlertRecord], cause: Cause
) -> datetime:
    reference = facts.reference
    if alerts:
        return alert_since(alerts[0])
    if state == PoseState.NO_DATA and facts.clockwork.last_track_s is not None:
        return datetime.fromtimestamp(facts.clockwork.last_track_s, UTC)
    if cause in (Cause.PUT_BACK, Cause.FALSE_ALARM) and reference.answered_at is not None:
        return reference.answered_at
    return reference.created_at if reference.ready_at is None else reference.ready_at
