"""Level-triggered upkeep: what the store says should be under way, is queued."""

import logging
from datetime import UTC, datetime
from functools import partial

from sqlalchemy.orm import Session

from service.alerts.alerts import end_empty_groups
from service.alerts.data_gaps import watch_data_gap
from service.alerts.escalation import escalate
from service.alerts.silence import end_silences
from service.alerts.staleness import StaleWatch
from service.cameras.maintenance import note_ends
from service.cameras.sources import watch_sources
from service.estimate_queue import queue_overlooked, request_estimate
from service.job_queue import JobQueue
from service.notifications import deliveries
from service.references import window_of
from service.settings import Settings
from service.store import cameras, references, tracks, trainings, windows
from service.store.cameras import CameraRecord
from service.training import StepWatch, requeue_lost, train_if_needed
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")
_CAMERAS_HZ = 10  # reconciled, of hundreds: all of them at once took a quarter of a core


def run_sweep(context: JobContext) -> None:
    """Queue a look at cameras that were posted to while they were looked at, or cooled down."""
    context.store.write_if_needed("sweep/", partial(queue_overlooked, queue=context.queue))


def run_reconcile(context: JobContext, stale: StaleWatch) -> None:
    """Enqueue what the store says should be under way; a lost nudge costs seconds.

    Cameras have turns, ten a second: of 500 each has one in 50 s.
    """
    with context.store.read() as session:
        camera_ids = cameras.ids(session)
        webhook_ids = deliveries.awaited(session, context.settings)
    for webhook_id in webhook_ids:
        with context.store.write(f"webhook/{webhook_id}") as session:
            deliveries.reconcile_webhook(session, context.queue, webhook_id)
    most = _CAMERAS_HZ * context.settings.reconcile_s
    for camera_id in context.reconciled.take(camera_ids, most):
        # A transaction a camera, so that posts never wait long for the write lock; most cameras
        # are as they should be.
        found = context.store.write_if_needed(camera_id, partial(_reconcile, context, camera_id))
        for reason in found:
            log.info("reconciled", extra={"camera_id": camera_id, "reason": reason})
    changed = context.store.write_if_needed(None, partial(_reconcile_alerts, context, stale))
    for camera_id, change in changed.items():
        log.warning("stale", extra={"camera_id": camera_id, "alert": change})


def reconcile_camera(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    steps: StepWatch | None = None,
) -> list[str]:
    """Enqueue what the store says should be under way for a camera; says what it found.

    Without `steps` nothing is remembered of what its tracks were.
    """
    camera = session.get(CameraRecord, camera_id)
    if camera is None:
        return []
    now = datetime.now(UTC)
    found = [train_if_needed(session, queue, settings, camera, steps or StepWatch())]
    if requeue_lost(session, queue, camera_id):
        found.append("training without a job")
    if camera.estimate_due_at is None and _is_behind(session, settings, camera):
        request_estimate(session, queue, camera_id)
        found.append("tracks that nothing has looked at")
    found.append(watch_sources(session, queue, settings, camera_id, now))
    if note_ends(session, camera_id, now):
        found.append("maintenance that has come to its end")
    found.append(watch_data_gap(session, settings, camera_id, now))
    return [reason for reason in found if reason is not None]


def reconcile_alerts(session: Session) -> None:
    """End silences that have come to their time, and groups whose cameras are gone."""
    end_silences(session)
    end_empty_groups(session)


def _reconcile(context: JobContext, camera_id: str, session: Session) -> list[str]:
    return reconcile_camera(session, context.queue, context.settings, camera_id, context.steps)


def _reconcile_alerts(context: JobContext, stale: StaleWatch, session: Session) -> dict[str, str]:
    reconcile_alerts(session)
    escalate(session, context.settings)
    return stale.watch(session, context.settings)


def _is_behind(session: Session, settings: Settings, camera: CameraRecord) -> bool:
    """True where there are tracks that no estimate job, or not the model in use, has looked at."""
    newest_pk = tracks.newest_pk(session, camera.id)
    if newest_pk is None:
        return False
    if camera.read_track_pk is None or camera.read_track_pk < newest_pk:
        return True
    model = trainings.newest_model(session, camera.id)
    if model is None:
        return False
    bounds = window_of(session, references.newest(session, camera.id), settings)
    return bool(windows.without_prediction(session, bounds, model.id, 1))
