"""The health of the service: its readiness, as `/readyz` says it, and the metrics of a moment."""

import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.alerts.bridges import problem_of
from service.cameras.status import CameraStatus, camera_statuses
from service.enums import RunKind, TrainingState
from service.errors import ServiceError
from service.operations.result_ages import ResultAges, result_ages
from service.settings import Settings
from service.store import (
    bridges,
    cameras,
    fleet,
    journal,
    runs,
    tracks,
    trainings,
    webhooks,
    workers,
)
from service.store.alerts import AlertRecord
from service.store.bridges import BridgeRecord
from service.store.cameras import CameraRecord
from service.store.engines.dialects import now_in
from service.store.engines.failures import failure_of
from service.store.engines.store import Store
from service.store.runs import RunTotal
from service.wording.reasons import in_words

_LONGEST_LAG_S = 60.0
_FULL_MB = 1.0  # a small write, as ours is, may still find room in the file that is there
_NAMED_CAMERAS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Readiness:
    """Readiness for work, and what is wrong.

    A camera whose looks fail is a problem that is named, but does not make the service unready:
    restarting it, or sending posts elsewhere, would harm all the others. Where most of them fail,
    it is not a camera's fault. A failing bridge is named likewise; `bridge_silent_s` is the longest
    silence of a bridge, None if none runs. `queue_lag_s` is the age of the oldest track that
    nothing has looked at.
    """

    problems: tuple[str, ...]
    store_writable: bool = False
    worker_alive: bool = False
    worker_silent_s: float | None = None
    queue_lag_s: float = 0.0
    failing_cameras: int = 0
    bridge_silent_s: float | None = None
    ready: bool = False


def check_readiness(store: Store, settings: Settings) -> Readiness:
    """Write something; look at the disk, the workers, the oldest unseen track, failing looks."""
    now = datetime.now(UTC)
    try:
        with store.write("probe/") as session:
            workers.write_probe(session, now)
        with store.read() as session:
            known, asked = workers.every(session), now_in(session)
            carrying = bridges.every(session)
            failing = {camera.id: camera for camera in cameras.failing(session)}
            count = cameras.count(session)
            came = {camera_id: at for camera_id, (_, at) in tracks.unseen_since(session).items()}
    except (SQLAlchemyError, ServiceError) as error:
        return _unwritable(error)
    free_mb = shutil.disk_usage(settings.data_dir).free / 2**20
    # A heartbeat of the future is one of before the clock was set back: no sign of life either.
    heartbeat = workers.last_heard(known)
    silent_s = None if heartbeat is None else abs((asked - heartbeat).total_seconds())
    alive = silent_s is not None and silent_s < settings.worker_lost_s
    # Who fails is named below, and rests between its tries: it does not hold up the queue.
    waits_s = _oldest_s([at for camera, at in came.items() if camera not in failing], now)
    problems = [*_disk_problems(settings, free_mb), *([] if alive else [_lost(settings, silent_s)])]
    if waits_s > _LONGEST_LAG_S:
        problems.append(
            f"queue: tracks wait for {waits_s:.0f} s; {_LONGEST_LAG_S:g} s are the limit"
        )
    if 2 * len(failing) > count:
        problems.append(f"estimates: they fail for {len(failing)} of {count} cameras")
    named = [f"worker: {each.name} {each.trouble}" for each in known if each.trouble is not None]
    return Readiness(
        store_writable=free_mb >= _FULL_MB,
        worker_alive=alive,
        worker_silent_s=silent_s,
        queue_lag_s=_oldest_s(list(came.values()), now),
        failing_cameras=len(failing),
        # The API works without a bridge, and restarting it would not help.
        bridge_silent_s=max(_silent_s(carrying, asked), default=None),
        ready=not problems,
        problems=(
            *problems,
            *named,
            *_failing_bridges(carrying, asked),
            *_failing_cameras(failing),
        ),
    )


def _unwritable(error: SQLAlchemyError | ServiceError) -> Readiness:
    known = failure_of(error) if isinstance(error, SQLAlchemyError) else error
    detail = f"store: {error.__class__.__name__}: {error}" if known is None else known.detail
    return Readiness(problems=(detail if detail.startswith("store: ") else f"store: {detail}",))


def _disk_problems(settings: Settings, free_mb: float) -> list[str]:
    if free_mb < _FULL_MB:
        return [f"store: the disk is full, {free_mb:.1f} MiB are free"]
    if free_mb < settings.min_free_mb:
        return [f"disk: {free_mb:.0f} MiB are free; {settings.min_free_mb:g} are the least"]
    return []


def _lost(settings: Settings, silent_s: float | None) -> str:
    heard = "none was ever heard of" if silent_s is None else f"silent for {silent_s:.0f} s"
    return f"worker: {heard}; up to {settings.worker_lost_s:g} s are waited for"


def _silent_s(known: Sequence[BridgeRecord], now: datetime) -> list[float]:
    running = [record for record in known if not record.stopped]
    return [abs((now - record.heartbeat_at).total_seconds()) for record in running]


def _failing_bridges(known: Sequence[BridgeRecord], now: datetime) -> list[str]:
    found = [problem_of(record, now) for record in known]
    return [f"bridge: {in_words((problem,))}" for problem in found if problem is not None]


def _failing_cameras(failing: dict[str, CameraRecord]) -> list[str]:
    if not failing:
        return []
    first, names = next(iter(failing.values())), list(failing)
    rest = len(names) - _NAMED_CAMERAS
    some = ", ".join(names[:_NAMED_CAMERAS]) + (f" and {rest} more" if rest > 0 else "")
    return [
        f"cameras: the estimates of {len(failing)} fail ({some}); of {first.id} "
        f"with {first.estimate_error}"
    ]


def _oldest_s(received: Sequence[datetime], now: datetime) -> float:
    return max(((now - at).total_seconds() for at in received), default=0.0)


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
    bridges: Sequence[BridgeRecord]
    runs: Mapping[RunKind, RunTotal]
    result_ages: Mapping[RunKind, ResultAges]


def load_metrics(session: Session, settings: Settings) -> Metrics:
    """The metrics now, by a dozen statements for all cameras."""
    now = datetime.now(UTC)
    waiting = tracks.unseen_since(session)
    unseen_s = {
        camera_id: max((now - at).total_seconds(), 0.0) for camera_id, (_, at) in waiting.items()
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
        bridges=bridges.every(session),
        runs=runs.totals(session),
        result_ages=result_ages(session, waiting, now),
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
