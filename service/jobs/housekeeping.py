"""The periodic jobs: reconcile every few seconds, retention every hour."""

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


def run_retention(context: JobContext) -> None:
    """Delete what the limits on age and number say, and weights that no model names."""
    with context.store.read() as session:
        ids = upkeep.camera_ids(session)
    for camera_id in ids:
        with context.store.write() as session:
            deleted = upkeep.forget_old(session, context.settings, camera_id)
        if deleted:
            log.info("tracks_deleted", extra={"camera_id": camera_id, "tracks": deleted})
    with context.store.write() as session:
        upkeep.forget_events(session, context.settings)
        upkeep.forget_activity(session, context.settings)
        deliveries.forget_deliveries(session, context.settings)
        for path in upkeep.unused_weights(session, context.settings.weights_dir):
            path.unlink(missing_ok=True)
