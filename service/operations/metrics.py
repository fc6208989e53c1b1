"""The metrics of a moment: what operators of the service watch."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.cameras.status import CameraStatus, camera_statuses
from service.enums import TrainingState
from service.settings import Settings
from service.store import cameras, fleet, journal, tracks, trainings, webhooks, workers
from service.store.alerts import AlertRecord


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
    """Everything at one moment, with the alerts that fire.

    Heartbeats are seconds since the Unix epoch. `unseen_s` is the age of the oldest track of a
    camera that nothing has looked at, where there is one; `failing` are the cameras whose last look
    failed.
    """

    at: datetime
    cameras: Collection[CameraStatus]
    alerts: Sequence[AlertRecord]
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
    known = workers.every(session)
    return Metrics(
        at=now,
        cameras=camera_statuses(session, settings).values(),
        alerts=[*fleet.firing(session, None), *fleet.firing_groups(session)],
        webhooks=_webhooks(session, now),
        trainings=trainings.count_by_state(session),
        heartbeats_s={worker.name: worker.heartbeat_at.timestamp() for worker in known},
        worker_starts={worker.name: worker.starts for worker in known},
        unseen_s=unseen_s,
        failing=tuple(camera.id for camera in cameras.failing(session)),
        queue_lag_s=max(unseen_s.values(), default=0.0),
        events=journal.newest_event_id(session),
    )


def _webhooks(session: Session, now: datetime) -> tuple[WebhookMetrics, ...]:
    backlogs = webhooks.backlogs(session)
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
