"""The periodic job of every few seconds: reconcile."""

import logging

from service.jobs.context import JobContext
from service.recalibration import deliveries, upkeep

log = logging.getLogger("surefoot.jobs")


def run_reconcile(context: JobContext) -> None:
    """Enqueue what the store says should be under way; a lost nudge costs seconds."""
    with context.store.read() as session:
        ids = upkeep.camera_ids(session)
        webhook_ids = deliveries.awaited(session, context.settings)
    for webhook_id in webhook_ids:
        with context.store.write() as session:
            deliveries.reconcile_webhook(session, context.queue, webhook_id)
    for camera_id in ids:
        # One transaction a camera, so that posts never wait long for the write lock.
        with context.store.write() as session:
            found = upkeep.reconcile_camera(session, context.queue, context.settings, camera_id)
        for reason in found:
            log.info("reconciled", extra={"camera_id": camera_id, "reason": reason})
    with context.store.write() as session:
        upkeep.reconcile_alerts(session)
