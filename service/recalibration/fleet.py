"""All cameras at a glance: what each does, and which of them need a person first."""

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.recalibration.attendance import Attendance, attendance_by
from service.recalibration.limits import drift_limits
from service.recalibration.outbox import is_silenced
from service.recalibration.poses import PoseState, counting_beside, state_by
from service.recalibration.presence import is_no_data
from service.recalibration.references import tracks_so_far, wanted_tracks
from service.recalibration.rhythms import unpacked
from service.settings import Settings
from service.store import figures, fleet
from service.store.tables import (
    AlertRecord,
    EstimateRecord,
    SiteReferenceRecord,
    TrainingRecord,
)

_HISTORY = 24  # estimates of a sparkline


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetDrift:
    """What is told of a camera's drift; a number that is not told, or not sure, is None."""

    angle_rad: float | None
    tilt_rad: float | None
    roll_rad: float | None
    heading_rad: float | None
    height_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetAlert:
    """An alert that fires, as far as a row has room for it."""

    alert_id: str
    kind: str
    severity: str
    reason: str
    since: datetime
    acknowledged_by: str | None
    silenced_until: datetime | None
    grouped: bool

    @property
    def waits(self) -> bool:
        """Whether nobody has taken it up, and nobody speaks for it."""
        return not (self.acknowledged_by or self.silenced_until or self.grouped)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTraining:
    """A training that waits or is under way; `share` is how much of it is done."""

    state: str
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetCamera:
    """A camera in one line.

    `history` has the drift of its newest estimates in units of the limits, oldest first, None
    where nothing was told. `learned` and `wanted` are people of the reference being learned.
    """

    camera_id: str
    name: str
    state: PoseState
    since: datetime | None
    last_track_s: float | None
    drift: FleetDrift | None
    history: tuple[float | None, ...]
    learned: int | None
    wanted: int
    doubt: str
    alerts: tuple[FleetAlert, ...]
    training: FleetTraining | None
    attended_until: datetime | None

    @property
    def alert(self) -> FleetAlert | None:
        """The alert that needs a person most."""
        return self.alerts[0] if self.alerts else None

    @property
    def rank(self) -> int:
        """How soon it needs a person: 0 at once, 7 not at all."""
        if self.attended_until is not None:
            return 5
        if self.alert is not None:
            if not self.alert.waits:
                return 5 if self.alert.silenced_until else 3
            return 0 if self.alert.severity == "critical" else 1
        return {"drifting": 2, "out_of_range": 2, "no_data": 4, "learning": 6, "ok": 7}[self.state]

    @property
    def order(self) -> tuple[int, float, str]:
        """Sorts first what a person should look at first; of one kind the newest, then by name."""
        at_s = self.since.timestamp() if self.since is not None and self.rank < 6 else 0.0
        return self.rank, -at_s, self.name.casefold()


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetGroup:
    """An alert that blames a tracker or its clock for what many cameras show."""

    alert: FleetAlert
    track_source: str
    cameras: tuple[tuple[str, str], ...]


def list_fleet(
    session: Session, settings: Settings, ids: Collection[str] | None = None
) -> list[FleetCamera]:
    """All cameras, or some, those first that need a person; a dozen statements for all of them."""
    now = datetime.now(UTC)
    references = figures.newest_references(session, ids)
    estimates = figures.newest_estimates(session, ids)
    ended_s = figures.last_tracks_s(session, ids)
    history = fleet.drift_history(session, ids, _HISTORY, drift_limits(settings))
    counts = fleet.learning_counts(session, ids)
    windows = fleet.maintenance_windows(session, ids)
    trainings = fleet.unfinished_trainings(session, ids)
    rhythms = fleet.rhythm_profiles(session, ids)
    alerts: dict[str, list[FleetAlert]] = defaultdict(list)
    for record in fleet.firing(session, ids):
        alerts[str(record.camera_id)].append(_alert(record, now))
    found = []
    for camera_id, name in fleet.names(session, ids):
        reference, last_s = references[camera_id], ended_s[camera_id]
        attended = attendance_by(windows[camera_id], now)
        estimate = counting_beside(attended, settings, reference, estimates.get(camera_id), now)
        known = unpacked(rhythms[camera_id]) if camera_id in rhythms else None
        state = state_by(reference, estimate, silent=is_no_data(settings, known, last_s, now))
        firing = tuple(sorted(alerts[camera_id], key=_urgency))
        found.append(
            FleetCamera(
                camera_id=camera_id,
                name=name,
                state=state,
                since=_since(state, firing, reference, last_s),
                last_track_s=last_s,
                drift=_drift(estimate) if state != "learning" else None,
                history=tuple(history[camera_id]),
                learned=_learned(session, settings, reference, counts, attended),
                wanted=wanted_tracks(reference, settings),
                doubt=reference.doubt,
                alerts=firing,
                training=_training(trainings.get(camera_id)),
                attended_until=_attended_until(attended, now),
            )
        )
    return sorted(found, key=lambda camera: camera.order)


def list_groups(session: Session) -> list[FleetGroup]:
    """The alerts that blame trackers, the newest first."""
    now = datetime.now(UTC)
    groups = fleet.firing_groups(session)
    wanted = {camera_id for group in groups for camera_id in group.camera_ids or []}
    names = dict(fleet.names(session, wanted)) if wanted else {}
    return [
        FleetGroup(
            alert=_alert(group, now),
            track_source=group.track_source or "",
            cameras=tuple((i, names[i]) for i in group.camera_ids or [] if i in names),
        )
        for group in groups
    ]


def _alert(record: AlertRecord, now: datetime) -> FleetAlert:
    return FleetAlert(
        alert_id=record.id,
        kind=record.kind,
        severity=record.severity,
        reason=record.reason,
        since=record.changed_at or record.opened_at,
        acknowledged_by=record.acknowledged_by,
        silenced_until=record.silenced_until if is_silenced(record, now) else None,
        grouped=record.group_id is not None,
    )


def _urgency(alert: FleetAlert) -> tuple[bool, bool, datetime]:
    return not alert.waits, alert.severity != "critical", alert.since


def _since(
    state: PoseState,
    alerts: Sequence[FleetAlert],
    reference: SiteReferenceRecord,
    last_s: float | None,
) -> datetime | None:
    if alerts:
        return alerts[0].since
    if state == "no_data" and last_s is not None:
        return datetime.fromtimestamp(last_s, UTC)
    return reference.created_at if reference.ready_at is None else reference.ready_at


def _drift(estimate: EstimateRecord | None) -> FleetDrift | None:
    """What is told and sure enough to be said: beyond 2 sd, or what has been found to drift."""
    if estimate is None or not estimate.told:
        return None
    e = estimate
    numbers = {
        "tilt": (e.drift_tilt_rad, e.tilt_sd_rad),
        "roll": (e.drift_roll_rad, e.roll_sd_rad),
        "heading": (e.drift_heading_rad, e.heading_sd_rad or 0.0),
        "height": (e.drift_height_m, e.height_sd_m),
    }
    sure = {
        name: value
        for name, (value, sd) in numbers.items()
        if name in e.told and (name in e.drifted or abs(value) > 2 * sd)
    }
    return FleetDrift(
        angle_rad=e.drift_angle_rad if set(sure) - {"height"} else None,
        tilt_rad=sure.get("tilt"),
        roll_rad=sure.get("roll"),
        heading_rad=sure.get("heading"),
        height_m=sure.get("height"),
    )


def _learned(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    counts: dict[str, int],
    attended: Attendance,
) -> int | None:
    if reference.ready_at is not None:
        return None
    if attended.spans:
        return tracks_so_far(session, settings, reference)  # few, which need a statement each
    return min(counts.get(reference.camera_id, 0), wanted_tracks(reference, settings))


def _training(record: TrainingRecord | None) -> FleetTraining | None:
    if record is None:
        return None
    return FleetTraining(
        state=record.state, share=record.step / record.steps if record.steps else 0
    )


def _attended_until(attended: Attendance, now: datetime) -> datetime | None:
    if not attended.under_way(now):
        return None
    now_s = now.timestamp()
    return datetime.fromtimestamp(
        next(to_s for at, to_s in attended.spans if at <= now_s < to_s), UTC
    )
