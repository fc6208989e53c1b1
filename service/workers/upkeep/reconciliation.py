"""Level-triggered upkeep: what should be under way."""

from collections.abc import Sequence
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.alerts.alerts import end_empty_groups
from service.alerts.presence import watch_presence
from service.alerts.silence import end_silences
from service.cameras.maintenance import note_ends
from service.cameras.sources import watch_sources
from service.enums import TrainingState
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import cameras, predictions, references, tracks, trainings
from service.store.cameras import CameraRecord
from service.training.lost_trainings import requeue_lost
from service.training.steps import StepWatch
from service.training.unasked import train_by_itself
from service.windows.looking import rests
from service.windows.references import window_of
from service.windows.requests import request_estimate


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
    camera = cameras.find(session, camera_id)
    if camera is None:
        return []
    found = []
    by_themselves = settings.trainings != "off"
    reason = _why_train(session, camera, steps or StepWatch()) if by_themselves else None
    if reason is not None and train_by_itself(session, queue, settings, camera_id) is not None:
        found.append(reason)
    if requeue_lost(session, queue, camera_id):
        found.append("training without a job")
    if camera.estimate_due_at is None and _is_behind(session, settings, camera):
        request_estimate(session, queue, camera_id)
        found.append("tracks that nothing has looked at")
    source = watch_sources(session, queue, settings, camera_id, datetime.now(UTC))
    if source is not None:
        found.append(source)
    if note_ends(session, camera_id, datetime.now(UTC)):
        found.append("maintenance that has come to its end")
    presence = watch_presence(session, settings, camera_id, datetime.now(UTC))
    if presence is not None:
        found.append(presence)
    return found


def overlooked(session: Session, queue: JobQueue) -> list[str]:
    """Cameras that are due and may be looked at, without a job that waits or runs.

    They were posted to while they were looked at or rested, or the engine has lost their job.
    """
    now = datetime.now(UTC)
    return [
        camera_id
        for camera_id, rests_until in queue.due_without_job(session)
        if not rests(rests_until, now)
    ]


def queue_overlooked(session: Session, queue: JobQueue, camera_ids: Sequence[str]) -> None:
    """Queue a look at each of some cameras; those first that have been due for longest."""
    for camera_id in camera_ids:
        camera = cameras.find(session, camera_id)
        if camera is not None and camera.estimate_due_at is not None:
            queue.enqueue_estimate(session, camera_id, camera.estimate_due_at, urgent=camera.urgent)


def reconcile_alerts(session: Session) -> None:
    """End silences that have come to their time, and groups whose cameras are gone."""
    end_silences(session)
    end_empty_groups(session)


def camera_ids(session: Session) -> Sequence[str]:
    """The ids of all cameras, in order."""
    return cameras.ids(session)


def _is_behind(session: Session, settings: Settings, camera: CameraRecord) -> bool:
    """Whether there are tracks that no estimate job, or not the model in use, has looked at."""
    newest_pk = tracks.newest_pk(session, camera.id)
    if newest_pk is None:
        return False
    if camera.looked_at_pk is None or camera.looked_at_pk < newest_pk:
        return True
    model = trainings.newest_model(session, camera.id)
    if model is None:
        return False
    bounds = window_of(session, references.newest(session, camera.id), settings)
    return bool(predictions.without_prediction(session, bounds, model.id, 1))


def _why_train(session: Session, camera: CameraRecord, steps: StepWatch) -> str | None:
    if trainings.unfinished(session, camera.id):
        return None
    prior = cameras.prior_pose(session, camera.id)
    newest = trainings.of_camera(session, camera.id, 1)
    if (
        newest
        and newest[0].prior_pose_id == prior.id
        and newest[0].state in (TrainingState.FAILED, TrainingState.CANCELLED)
    ):
        return None  # trying the same again needs a person, or another prior pose
    model = trainings.newest_model(session, camera.id)
    if model is None:
        return "camera without a model"
    if model.prior_pose_id != prior.id:
        return "model older than the prior pose"
    if not steps.fits(session, camera.id, model.step_s):
        return "model of another sampling step than the tracks offer"
    return None
