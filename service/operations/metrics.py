"""The metrics of a moment: what operators of the service watch."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.monitoring.verdict import Drift
from service.cameras.standing import Standing, standings
from service.enums import AlertKind, PoseState, Severity, TrainingState
from service.notifications.outbox import is_silenced
from service.settings import Settings
from service.store import cameras, events, metrics, tracks, webhooks


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraMetrics:
    """A camera: its state, its newest track and its drift, where there is an estimate."""

    camera_id: str
    state: PoseState
    last_track_s: float | None
    drift: Drift | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertMetrics:
    """An alert that fires; `camera_id` is empty where it is of no one camera.

    It is `grouped` where another one speaks for it.
    """

    camera_id: str
    kind: AlertKind
    severity: Severity
    silenced: bool
    grouped: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class WebhookMetrics:
    """A webhook: what waits for it, how long it has, and how long it has been failing."""

    webhook_id: str
    name: str
    enabled: bool
    pending: int
    oldest_s: float
    failing_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Metrics:
    """Everything at one moment. Heartbeats are seconds since the Unix epoch.

    `unseen_s` is the age of the oldest track of a camera that nothing has looked at, where there is
    one; `failing` are the cameras whose last look failed.
    """

    cameras: tuple[CameraMetrics, ...]
    alerts: tuple[AlertMetrics, ...]
    webhooks: tuple[WebhookMetrics, ...]
    trainings: dict[TrainingState, int]
    heartbeats_s: dict[str, float]
    worker_starts: dict[str, int]
    unseen_s: dict[str, float]
    failing: tuple[str, ...]
    queue_lag_s: float
    events: int


def load_metrics(session: Session, settings: Settings) -> Metrics:
    """The metrics now, by a dozen statements for all cameras."""
    now = datetime.now(UTC)
    unseen_s = {
        camera_id: max((now - at).total_seconds(), 0.0)
        for camera_id, (_, at) in tracks.unseen_since(session).items()
    }
    workers = metrics.workers(session)
    return Metrics(
        cameras=_cameras(standings(session, settings)),
        alerts=tuple(
            AlertMetrics(
                camera_id=alert.camera_id or "",
                kind=alert.kind,
                severity=alert.severity,
                silenced=is_silenced(alert, now),
                grouped=alert.group_id is not None,
            )
            for alert in metrics.firing(session)
        ),
        webhooks=_webhooks(session, now),
        trainings=metrics.trainings_by_state(session),
        heartbeats_s={worker.name: worker.heartbeat_at.timestamp() for worker in workers},
        worker_starts={worker.name: worker.starts for worker in workers},
        unseen_s=unseen_s,
        failing=tuple(camera.id for camera in cameras.failing(session)),
        queue_lag_s=max(unseen_s.values(), default=0.0),
        events=events.newest_id(session),
    )


def _cameras(standing: dict[str, Standing]) -> tuple[CameraMetrics, ...]:
    return tuple(
        CameraMetrics(
            camera_id=camera_id,
            state=each.state,
            last_track_s=each.last_track_s,
            drift=None if each.estimate is None else each.estimate.drift,
        )
        for camera_id, each in standing.items()
    )


def _webhooks(session: Session, now: datetime) -> tuple[WebhookMetrics, ...]:
    backlogs = metrics.backlogs(session)
    found = []
    for record in webhooks.every(session):
        backlog = backlogs.get(record.id)
        failing = record.failing_since
        found.append(
            WebhookMetrics(
                webhook_id=record.id,
                name=record.name,
                enabled=record.enabled,
                pending=0 if backlog is None else backlog.count,
                oldest_s=0.0 if backlog is None else (now - backlog.oldest_at).total_seconds(),
                failing_s=0.0 if failing is None else (now - failing).total_seconds(),
            )
        )
    return tuple(found)
