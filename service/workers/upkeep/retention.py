"""Retention: delete what is beyond the limits until nothing is, and give the space back."""

import logging

from service.store.engines import files
from service.workers.context import JobContext
from service.workers.in_hand import UPKEEP
from service.workers.upkeep import limits, reconciliation
from service.workers.upkeep.limits import BITE, Limit

log = logging.getLogger("surefoot.jobs")

_PAUSE_S = 0.02  # between bites: who waits for the write lock gets it
_PAGES_AT_ONCE = 2_000
_PAGES_LEFT = 256  # a megabyte, which the next hour fills again


def run_retention(context: JobContext) -> None:
    """Apply all limits, delete weights that no model names, and let the file shrink."""
    settings = context.settings
    with context.store.read() as session:
        ids = reconciliation.camera_ids(session)
    for camera_id in ids:
        for limit in limits.limits_of_camera(settings, camera_id):
            _apply(context, limit, camera_id)
    for limit in limits.limits_of_all(settings):
        _apply(context, limit, None)
    # Under the write lock: a model that is published meanwhile waits, and its file is young.
    with context.store.write() as session:
        for path in limits.unused_weights(session, settings.weights_dir):
            path.unlink(missing_ok=True)
    if settings.database_url is None:  # a server sees to its own disk
        _shrink(context)


def _apply(context: JobContext, limit: Limit, camera_id: str | None) -> None:
    deleted, bite = 0, BITE
    while bite >= BITE and not context.stopping.is_set():
        with context.in_hand.task(UPKEEP, limit.name):
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
        with context.in_hand.task(UPKEEP, "shrink"):
            files.give_back(path, min(_PAGES_AT_ONCE, free - _PAGES_LEFT))
    files.wipe_log(path, patience_ms=200)
    if files.size(path) < before:
        log.info("shrunk", extra={"bytes": files.size(path), "from_bytes": before})
