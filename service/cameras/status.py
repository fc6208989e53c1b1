"""A camera's status: the one derivation that pages, API, metrics and lists of alerts share.

While an alert that an estimate fired is open, the camera is taken for moved, whatever else is
known of it, and the last identifiable pose is served. Once a person has answered (it was put back,
it was a false alarm, its pose is accepted), nothing that was estimated before counts any more.
"""

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.monitoring.drift import Drift
from service.alerts.data_gaps import is_no_data
from service.enums import AlertSource, Cause, Origin, PoseState, Severity
from service.references import Attendance, attendance_by, made_against
from service.settings import Settings
from service.store import fleet
from service.store.alerts import MOVED_KINDS, AlertRecord
from service.store.estimates import EstimateRecord
from service.store.references import MaintenanceRecord, SiteReferenceRecord

_ANSWERED = (Cause.PUT_BACK, Cause.FIXED, Cause.FALSE_ALARM)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraStatus:
    """A camera's status. `alerts` are all that fire, what needs a person most first.

    `estimate` is what is served, maybe nothing identifiable; None where the prior pose is. It is
    `judged` where it says how the camera stands now, against its reference; else it is the last
    that is known, or of a reference that is being learned. `cause` is what is waited after until
    then. It is `silent` where nobody has been seen for longer than is usual; `last_track_s` is the
    end of the newest track of those that count. `images` counts those that were compared.
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
    last_track_s: float | None
    images: int

    @property
    def drift(self) -> Drift | None:
        """The drift of the estimate; None where there is none."""
        return None if self.estimate is None else self.estimate.drift

    @property
    def in_question(self) -> bool:
        """True if a question is open about the tracks that its reference is learned from."""
        return self.reference.ready_at is None and bool(self.reference.doubts)

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Those of tilt, roll, height, heading that are estimated."""
        return () if self.estimate is None else tuple(self.estimate.identifiable)


def camera_statuses(
    session: Session,
    settings: Settings,
    ids: Collection[str] | None = None,
    *,
    lean: bool = False,
) -> dict[str, CameraStatus]:
    """The status of all cameras, or some, in order of their ids, by a handful of statements.

    With `lean`, references and estimates have no more than what their states are told by.
    """
    now = datetime.now(UTC)
    newest = fleet.newest(session, ids, lean=lean)
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
        if _holds(alerts)
        and camera_id in newest
        and (estimate := newest[camera_id].estimate) is not None
        and not estimate.identifiable
    ]
    before = fleet.newest_identifiable_estimates(session, without) if without else {}
    found = {}
    for camera_id, each in newest.items():
        found[camera_id] = _status_of(
            each,
            before.get(camera_id) if camera_id in without else each.estimate,
            attendance_by(windows.get(camera_id, []), now),
            sorted(firing[camera_id], key=lambda alert: _urgency(alert, now)),
            silent=is_no_data(settings, each.last_track_s, now, each.usual_gap_s, each.delay_s),
            now=now,
        )
    return found


def _status_of(
    newest: fleet.Newest,
    last_identifiable: EstimateRecord | None,
    attended: Attendance,
    alerts: Sequence[AlertRecord],
    *,
    silent: bool,
    now: datetime,
) -> CameraStatus:
    """A camera's status, by what is stored of it at a moment."""
    reference = newest.reference
    estimate = _counting(newest, attended, now)
    judged = estimate is not None and made_against(reference, estimate)
    cause = _cause(reference, attended, now)
    state: PoseState
    if _holds(alerts):
        estimate = estimate if judged else last_identifiable
        state = PoseState.DRIFTING
    elif reference.ready_at is None and reference.source is None and not newest.images:
        state = PoseState.UNCONNECTED  # the first track to be stored gives it a source, for good
    elif newest.assumed:
        state = PoseState.UNCALIBRATED
    elif judged and estimate is not None and reference.ready_at is None:
        state = estimate.state  # by images alone
    elif reference.ready_at is None or (not judged and cause != Cause.FALSE_ALARM):
        state = PoseState.LEARNING
    elif silent:
        state = PoseState.NO_DATA
    elif judged and estimate is not None:
        state = estimate.state
    else:
        state = PoseState.OK
    return CameraStatus(
        camera_id=reference.camera_id,
        state=state,
        since=_since(state, newest, alerts, cause),
        reference=reference,
        estimate=estimate,
        judged=judged,
        cause=cause,
        alerts=tuple(alerts),
        attended=attended,
        silent=silent,
        last_track_s=newest.last_track_s,
        images=newest.images,
    )


def _holds(alerts: Sequence[AlertRecord]) -> list[AlertRecord]:
    """The alerts that say that a camera has moved, as estimates found."""
    return [
        each for each in alerts if each.kind in MOVED_KINDS and each.source == AlertSource.ESTIMATE
    ]


def _counting(newest: fleet.Newest, attended: Attendance, now: datetime) -> EstimateRecord | None:
    """The newest estimate; None where it says nothing of how the camera stands now."""
    reference, estimate = newest.reference, newest.estimate
    if estimate is None or estimate.reference_id != reference.id:
        return None  # it was measured against a pose or a reference that no longer counts
    if reference.answered_at is not None and estimate.created_at <= reference.answered_at:
        return None
    if reference.ready_at is None and reference.source is not None:
        return estimate
    # Somebody was at it and has gone: it may stand elsewhere. While they are there it is not
    # judged, so what was told before stands.
    begins_s = max(attended.free_since_s(now) or 0.0, reference.window_from_s or 0.0)
    return estimate if estimate.to_s >= max(begins_s, reference.from_s or 0.0) else None


def _cause(reference: SiteReferenceRecord, attended: Attendance, now: datetime) -> Cause:
    """The last cause of all that have the camera judged anew."""
    left_s = attended.free_since_s(now)
    if reference.answer is not None and reference.answered_at is not None:
        if left_s is not None and left_s > reference.answered_at.timestamp():
            return Cause.MAINTENANCE
        return Cause(reference.answer)
    if left_s is not None and left_s > max(reference.from_s or 0.0, reference.to_s or 0.0):
        return Cause.MAINTENANCE
    return Cause.PUT_BACK if reference.origin == Origin.PUT_BACK else Cause.REFERENCE


def _urgency(alert: AlertRecord, now: datetime) -> tuple[bool, bool, datetime]:
    return not waits(alert, now), alert.severity != Severity.CRITICAL, alert_since(alert)


def waits(alert: AlertRecord, now: datetime) -> bool:
    """True if nobody has taken an alert up, and no group speaks for it."""
    return not (alert.acknowledged_by or alert.is_silenced(now) or alert.group_id is not None)


def alert_since(alert: AlertRecord) -> datetime:
    """Since when what an alert tells of is so, as far as is known."""
    return alert.changed_at or alert.opened_at


def _since(
    state: PoseState, newest: fleet.Newest, alerts: Sequence[AlertRecord], cause: Cause
) -> datetime:
    reference = newest.reference
    if alerts:
        return alert_since(alerts[0])
    if state == PoseState.SUSPECTED and newest.estimate and newest.estimate.drift_since:
        return newest.estimate.drift_since
    if state == PoseState.NO_DATA and newest.last_track_s is not None:
        return datetime.fromtimestamp(newest.last_track_s, UTC)
    if reference.answered_at is not None and cause in _ANSWERED:
        return reference.answered_at
    return reference.created_at if reference.ready_at is None else reference.ready_at
