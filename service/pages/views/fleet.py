"""All cameras at a glance: what each does, and which of them need a person first."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.monitoring.verdict import Drift
from service.cameras.standing import Standing, alert_since, standings
from service.enums import AlertKind, PoseState, Severity, TrainingState
from service.estimation.limits import drift_limits
from service.notifications.outbox import is_silenced
from service.reasons import Reasons
from service.references import Attendance, tracks_so_far, wanted_tracks
from service.settings import Settings
from service.store import fleet
from service.store.alerts import AlertRecord
from service.store.estimates import EstimateRecord
from service.store.trainings import TrainingRecord

_HISTORY = 24  # estimates of a sparkline
# How soon a camera without an alert needs a person.
_RANKS = {
    PoseState.DRIFTING: 2,
    PoseState.NO_DATA: 4,
    PoseState.LEARNING: 6,
    PoseState.OK: 7,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetAlert:
    """An alert that fires, as far as a row has room for it."""

    alert_id: str
    kind: AlertKind
    severity: Severity
    reasons: Reasons
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

    state: TrainingState
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetCamera:
    """A camera in one line.

    `history` has the drift of its newest estimates in units of the limits, oldest first, None where
    nothing was identifiable. `drift` has only what is sure. `learned` and `wanted` are people of
    the reference being learned. `judged` says whether the drift is of how it stands now, and not
    only the last that is known.
    """

    camera_id: str
    name: str
    state: PoseState
    judged: bool
    since: datetime
    last_track_s: float | None
    drift: Drift | None
    history: tuple[float | None, ...]
    learned: int | None
    wanted: int
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
            return 0 if self.alert.severity == Severity.CRITICAL else 1
        return _RANKS[self.state]

    @property
    def order(self) -> tuple[int, float, str]:
        """Sorts first what a person should look at first; of one kind the newest, then by name."""
        at_s = self.since.timestamp() if self.rank < 6 else 0.0
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
    standing = standings(session, settings, ids)
    names = dict(fleet.names(session, ids))
    history = fleet.drift_history(session, ids, _HISTORY, drift_limits(settings))
    attended = {i: each.attended.spans for i, each in standing.items() if _learns(each)}
    counts = fleet.learning_counts(session, ids, attended)
    trainings = fleet.unfinished_trainings(session, ids)
    found = [
        FleetCamera(
            camera_id=camera_id,
            name=names[camera_id],
            state=each.state,
            judged=each.judged,
            since=each.since,
            last_track_s=each.last_track_s,
            drift=_drift(each.estimate) if each.state != PoseState.LEARNING else None,
            history=tuple(history[camera_id]),
            learned=_learned(settings, each, counts),
            wanted=wanted_tracks(each.reference, settings),
            alerts=tuple(_alert(record, now) for record in each.alerts),
            training=_training(trainings.get(camera_id)),
            attended_until=_attended_until(each.attended, now),
        )
        for camera_id, each in standing.items()
        if camera_id in names
    ]
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
        reasons=record.reasons,
        since=alert_since(record),
        acknowledged_by=record.acknowledged_by,
        silenced_until=record.silenced_until if is_silenced(record, now) else None,
        grouped=record.group_id is not None,
    )


def _drift(estimate: EstimateRecord | None) -> Drift | None:
    """What is sure enough to be said: beyond 2 sd, or what has been found to drift."""
    if estimate is None or not estimate.identifiable:
        return None
    drift, drifted = estimate.drift, estimate.drifted
    said = {name: drift.of(name) for name in drift.identifiable}
    sure = [name for name, (by, sd) in said.items() if name in drifted or abs(by) > 2 * sd]
    return replace(drift, identifiable=tuple(sure))


def _learns(standing: Standing) -> bool:
    return standing.reference.ready_at is None


def _learned(settings: Settings, standing: Standing, counts: dict[str, int]) -> int | None:
    if not _learns(standing):
        return None
    return tracks_so_far(standing.reference, settings, counts.get(standing.camera_id, 0))


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
