"""The rounds of the upkeep that come often: sweep twice a second, reconcile every few."""

import logging
import time
from datetime import timedelta
from functools import partial

from sqlalchemy.orm import Session

from service.alerts.staleness import StaleWatch
from service.notifications import deliveries
from service.workers.context import JobContext
from service.workers.processes.workforce import take_setback
from service.workers.upkeep import reconciliation

log = logging.getLogger("surefoot.jobs")
_JUMP_S = 2.0
_CAMERAS_HZ = 10  # reconciled, of hundreds: all of them at once took a quarter of a core


class ClockWatch:
    """Sees that the clock was set back, and has what waits for a time wait no longer for it."""

    def __init__(self) -> None:
        self._ahead_s = time.time() - time.monotonic()

    def look(self, context: JobContext) -> None:
        """Compare the clock with the monotonic one, that nobody sets."""
        ahead_s = time.time() - time.monotonic()
        back_s = self._ahead_s - ahead_s
        if back_s >= _JUMP_S:
            with context.store.write() as session:
                _follow(session, timedelta(seconds=back_s))
        self._ahead_s = ahead_s  # not before: where nothing could be written, it is seen again


def follow_clock_since_last_run(context: JobContext) -> None:
    """The same of a clock that was set back while no worker watched; before a worker registers."""
    with context.store.write() as session:
        back = take_setback(session)
        if back.total_seconds() >= _JUMP_S:
            _follow(session, back)


def _follow(session: Session, back: timedelta) -> None:
    moved = deliveries.follow_clock(session, back)
    log.warning("clock_set_back", extra={"by_s": round(back.total_seconds()), "deliveries": moved})


def run_sweep(context: JobContext) -> None:
    """Queue a look at cameras that were posted to while they were looked at, or rested."""
    with context.store.read() as session:
        overlooked = reconciliation.overlooked(session, context.queue)
    if overlooked:
        with context.store.write("sweep/") as session:
            reconciliation.queue_overlooked(session, context.queue, overlooked)


def run_reconcile(context: JobContext, stale: StaleWatch) -> None:
    """Enqueue what the store says should be under way; a lost nudge costs seconds.

    Cameras have turns, ten a second: of 500 each has one in 50 s.
    """
    with context.store.read() as session:
        ids = reconciliation.camera_ids(session)
        webhook_ids = deliveries.awaited(session, context.settings)
    for webhook_id in webhook_ids:
        with context.store.write(f"webhook/{webhook_id}") as session:
            deliveries.reconcile_webhook(session, context.queue, webhook_id)
    most = _CAMERAS_HZ * context.settings.reconcile_s
    for camera_id in context.reconciled.take(ids, most):
        # A transaction a camera, so that posts never wait long for the write lock; most cameras
        # are as they should be.
        found = context.store.write_if_needed(
            camera_id, partial(_reconcile_camera, context, camera_id)
        )
        for reason in found:
            log.info("reconciled", extra={"camera_id": camera_id, "reason": reason})
    changed = context.store.write_if_needed(None, partial(_reconcile_alerts, context, stale))
    for camera_id, change in changed.items():
        log.warning("stale", extra={"camera_id": camera_id, "alert": change})


def _reconcile_camera(context: JobContext, camera_id: str, session: Session) -> list[str]:
    return reconciliation.reconcile_camera(
        session, context.queue, context.settings, camera_id, context.steps
    )


def _reconcile_alerts(context: JobContext, stale: StaleWatch, session: Session) -> dict[str, str]:
    reconciliation.reconcile_alerts(session)
    return stale.watch(session, context.settings)
