"""Retention: delete what is beyond the limits, a bite at a time, and give the space back."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.regression.recipe import unused_weights
from service.settings import Settings
from service.store import (
    alerts,
    cameras,
    estimates,
    journal,
    references,
    runs,
    tracks,
    trainings,
    webhooks,
)
from service.store.engines import files
from service.workers.context import UPKEEP, JobContext

log = logging.getLogger("surefoot.jobs")

BITE = 500  # rows: posts wait for the write lock no longer than these take
_PAUSE_S = 0.02  # between bites: who waits for the write lock gets it
_KEPT_MODELS = 2
_RUN_HOURS = timedelta(days=7)
_PAGES_AT_ONCE = 2_000
_PAGES_LEFT = 256  # a megabyte, which the next hour fills again


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit on what is kept. `bite` deletes up to `BITE` rows, oldest first; how many it was."""

    name: str
    bite: Callable[[Session], int]


def run_retention(context: JobContext) -> None:
    """Apply all limits, delete weights that no model names, and let the file shrink."""
    settings = context.settings
    with context.store.read() as session:
        ids = cameras.ids(session)
    for camera_id in ids:
        for limit in limits_of_camera(settings, camera_id):
            _apply(context, limit, camera_id)
    for limit in limits_of_all(settings):
        _apply(context, limit, None)
    # Under the write lock: a model that is published meanwhile waits, and its file is young.
    with context.store.write() as session:
        for path in unused_weights(settings.weights_dir, trainings.weights_in_use(session)):
            path.unlink(missing_ok=True)
    if settings.database_url is None:  # a server sees to its own disk
        _shrink(context)


def limits_of_camera(settings: Settings, camera_id: str) -> Iterator[Limit]:
    """The limits on what is kept of a camera."""
    before = datetime.now(UTC) - timedelta(days=settings.keep_days)
    most_bytes = round(settings.keep_mb * 2**20)
    rows, poses = settings.keep_tracks, settings.keep_references
    yield Limit("tracks", lambda s: tracks.forget(s, camera_id, before, rows, BITE))
    if most_bytes:
        yield Limit(
            "tracks_by_size", lambda s: tracks.forget_tracks(s, camera_id, most_bytes, BITE)
        )
    yield Limit(
        "maintenance_windows", lambda s: references.forget_maintenance(s, camera_id, before, BITE)
    )
    kept = settings.keep_estimates
    yield Limit("estimates", lambda s: estimates.forget(s, camera_id, kept, BITE))
    yield Limit("models", lambda s: trainings.forget_models(s, camera_id, _KEPT_MODELS, BITE))
    ended = settings.keep_trainings
    yield Limit("trainings", lambda s: trainings.forget(s, camera_id, ended, BITE))
    yield Limit("references", lambda s: references.forget(s, camera_id, poses, BITE))
    yield Limit("prior_poses", lambda s: cameras.forget_poses(s, camera_id, poses, BITE))


def limits_of_all(settings: Settings) -> Iterator[Limit]:
    """The limits on what is kept of all cameras together, and of webhooks."""
    now = datetime.now(UTC)
    patience = now - timedelta(hours=settings.webhook_patience_h)
    ended = now - timedelta(days=settings.keep_deliveries_days)
    resolved = now - timedelta(days=settings.keep_alerts_days)
    done = now - timedelta(days=settings.keep_activity_days)
    yield Limit("events", lambda s: journal.forget_events(s, settings.keep_events, BITE))
    yield Limit("weights", lambda s: trainings.forget_weights(s, BITE))
    yield Limit("alerts", lambda s: alerts.forget(s, resolved, BITE))
    yield Limit("activity", lambda s: journal.forget_activity(s, done, BITE))
    yield Limit("deliveries_given_up", lambda s: webhooks.give_up(s, patience, now, BITE))
    yield Limit("deliveries", lambda s: webhooks.forget(s, ended, BITE))
    yield Limit("estimation_run_hours", lambda s: runs.forget(s, now - _RUN_HOURS, BITE))
    yield Limit("old_secrets", lambda s: webhooks.forget_old_secrets(s, now, BITE))


def _apply(context: JobContext, limit: Limit, camera_id: str | None) -> None:
    deleted, bite = 0, BITE
    while bite >= BITE and not context.stopping.is_set():
        with context.running.job(UPKEEP, limit.name):
            # Of hundreds of cameras nearly all are within their limits, each hour.
            bite = context.store.write_if_needed(camera_id or "retention/", limit.bite)
        deleted += bite
        if bite:
            context.stopping.wait(_PAUSE_S)
    if deleted:
        fields = {"limit": limit.name, "rows": deleted, "camera_id": camera_id}
        log.info("forgotten", extra={name: value for name, value in fields.items() if value})


def _shrink(context: JobContext) -> None:
    """Give free pages back, a bite at a time, and empty the log."""
    path = context.settings.database_path
    before = files.size(path)
    left = None
    while not context.stopping.wait(_PAUSE_S):
        free = files.free_pages(path)
        if free <= _PAGES_LEFT or free == left:
            break
        left = free
        with context.running.job(UPKEEP, "shrink"):
            files.give_back(path, min(_PAGES_AT_ONCE, free - _PAGES_LEFT))
    files.wipe_log(path, patience_ms=200)
    if files.size(path) < before:
        log.info("shrunk", extra={"bytes": files.size(path), "from_bytes": before})
