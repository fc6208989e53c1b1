"""The readiness of the service, as `/readyz` and its page say it."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.exc import SQLAlchemyError

from service.errors import OverloadedError
from service.settings import Settings
from service.store import cameras, tracks, workers
from service.store.cameras import CameraRecord
from service.store.engines.dialects import now_in
from service.store.engines.failures import failure_of
from service.store.engines.store import Store

_LONGEST_LAG_S = 60.0
_FULL_MB = 1.0  # a small write, as ours is, may still find room in the file that is there
_NAMED_CAMERAS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Readiness:
    """Readiness for work, and what is wrong.

    A camera whose looks fail is a problem that is named, but does not make the service unready:
    restarting it, or sending posts elsewhere, would harm all the others. Where most of them fail,
    it is not a camera's fault. `queue_lag_s` is the age of the oldest track that nothing has
    looked at.
    """

    store_writable: bool
    worker_alive: bool
    worker_silent_s: float | None
    queue_lag_s: float
    failing_cameras: int
    ready: bool
    problems: tuple[str, ...]


def check_readiness(store: Store, settings: Settings) -> Readiness:
    """Write something; look at the disk, the workers, the oldest unseen track, failing looks."""
    now = datetime.now(UTC)
    try:
        with store.write("probe/") as session:
            workers.write_probe(session, now)
        with store.read() as session:
            known, asked = workers.every(session), now_in(session)
            failing = {camera.id: camera for camera in cameras.failing(session)}
            count = cameras.count(session)
            came = {camera_id: at for camera_id, (_, at) in tracks.unseen_since(session).items()}
    except (SQLAlchemyError, OverloadedError) as error:
        return _unwritable(error)
    free_mb = shutil.disk_usage(settings.data_dir).free / 2**20
    # A heartbeat of the future is one of before the clock was set back: no sign of life either.
    heartbeat = max((each.heartbeat_at for each in known if not each.lost), default=None)
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
        ready=not problems,
        problems=(*problems, *named, *_failing_cameras(failing)),
    )


def _unwritable(error: SQLAlchemyError | OverloadedError) -> Readiness:
    known = failure_of(error) if isinstance(error, SQLAlchemyError) else error
    detail = f"store: {error.__class__.__name__}: {error}" if known is None else known.detail
    return Readiness(
        store_writable=False,
        worker_alive=False,
        worker_silent_s=None,
        queue_lag_s=0.0,
        failing_cameras=0,
        ready=False,
        problems=(detail if detail.startswith("store: ") else f"store: {detail}",),
    )


def _disk_problems(settings: Settings, free_mb: float) -> list[str]:
    if free_mb < _FULL_MB:
        return [f"store: the disk is full, {free_mb:.1f} MiB are free"]
    if free_mb < settings.min_free_mb:
        return [f"disk: {free_mb:.0f} MiB are free; {settings.min_free_mb:g} are the least"]
    return []


def _lost(settings: Settings, silent_s: float | None) -> str:
    heard = "none was ever heard of" if silent_s is None else f"silent for {silent_s:.0f} s"
    return f"worker: {heard}; up to {settings.worker_lost_s:g} s are waited for"


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
