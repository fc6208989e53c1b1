"""Queue, watch and cancel trainings, and publish what they made."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from models.regression.recipe import TrainingPlan, plan_to_config, plan_training
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import choose_step_s
from service.access.activity import note
from service.enums import Activity, EventType, TrainingState
from service.errors import ConflictError, NotFoundError
from service.estimate_queue import request_estimate
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import cameras, journal, tracks, trainings
from service.store.cameras import CameraRecord, PriorPoseRecord
from service.store.tracks import trajectory_of
from service.store.trainings import ModelRecord, TrainingRecord

# So many of the newest tracks tell a camera's sampling step, once there are at least a few.
_STEP_TRACKS = 200
_STEP_TRACKS_NEEDED = 20
_CENTRE = ("height_m", "tilt_rad", "roll_rad")  # what a training's centre may move from the prior


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingAttempt:
    """A training that a worker has taken up, and the plan to carry out."""

    training_id: str
    camera_id: str
    attempt: int
    plan: TrainingPlan


def queue_training(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    recipe: str | None = None,
    seed: int | None = None,
    around: CameraPose | None = None,
) -> TrainingRecord:
    """Queue a training of a camera, in the caller's transaction: around a pose, or its prior."""
    now = datetime.now(UTC)
    record = TrainingRecord(
        id=secrets.token_hex(16),
        camera_id=camera_id,
        prior_pose_id=cameras.prior_pose(session, camera_id).id,
        recipe=recipe or settings.recipe,
        around=None if around is None else {name: getattr(around, name) for name in _CENTRE},
        seed=settings.seed if seed is None else seed,
        state=TrainingState.QUEUED,
        attempt=0,
        cancel_requested=False,
        step=0,
        steps=0,
        queued_at=now,
    )
    session.add(record)
    session.flush()
    queue.enqueue_training(session, camera_id, record.id)
    _tell(session, record)
    return record


def request_training(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    recipe: str | None,
    seed: int | None,
    by: str | None,
) -> TrainingRecord:
    """Queue a training that a person asks for.

    Raises:
        NotFoundError: there is no such camera.
    """
    if session.get(CameraRecord, camera_id) is None:
        raise NotFoundError(f"camera_id: there is no camera {camera_id!r}")
    record = queue_training(session, queue, settings, camera_id, recipe, seed)
    note(session, Activity.TRAINING_REQUESTED, by=by, camera_id=camera_id, subject_id=record.id)
    return record


def show_training(session: Session, training_id: str) -> TrainingRecord:
    """A training.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = session.get(TrainingRecord, training_id)
    if record is None:
        raise NotFoundError(f"training_id: there is no training {training_id!r}")
    return record


def list_trainings(session: Session, camera_id: str, limit: int) -> Sequence[TrainingRecord]:
    """A camera's trainings, newest first.

    Raises:
        NotFoundError: there is no such camera.
    """
    if session.get(CameraRecord, camera_id) is None:
        raise NotFoundError(f"camera_id: there is no camera {camera_id!r}")
    return trainings.of_camera(session, camera_id, limit)


def cancel_training(session: Session, training_id: str) -> TrainingRecord:
    """Cancel a training: a queued one at once, a running one within a second or so.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: it has ended already.
    """
    record = show_training(session, training_id)
    if record.state not in trainings.UNFINISHED:
        raise ConflictError(f"state: only queued or running trainings end, this is {record.state}")
    _stop(session, record)
    return record


def stop_trainings(session: Session, camera_id: str) -> None:
    """Cancel whatever is under way for a camera whose lens or prior pose has changed."""
    for record in trainings.unfinished(session, camera_id):
        _stop(session, record)


def begin_training(
    session: Session, settings: Settings, training_id: str
) -> TrainingAttempt | None:
    """Mark a training as running and say what to do; None where there is nothing to do."""
    record = session.get(TrainingRecord, training_id)
    if record is None or record.state not in trainings.UNFINISHED:
        return None
    if record.cancel_requested:
        finish(session, record, TrainingState.CANCELLED)
        return None
    camera = session.get(CameraRecord, record.camera_id)
    assert camera is not None
    record.state = TrainingState.RUNNING
    record.attempt += 1
    record.started_at = datetime.now(UTC)
    record.step, record.loss, record.eta_s = 0, None, None
    _tell(session, record)
    return TrainingAttempt(
        training_id=training_id,
        camera_id=camera.id,
        attempt=record.attempt,
        plan=plan_training(
            intrinsics=camera.intrinsics,
            prior_pose=centre_of(session, record),
            recipe_name=record.recipe,
            walk=WalkConfig(
                speed_mean_mps=camera.walking_speed_mean_mps,
                speed_sd_mps=camera.walking_speed_sd_mps,
                step_s=camera_step_s(session, camera.id),
            ),
            seed=record.seed,
            epochs=settings.epochs,
        ),
    )


def centre_of(session: Session, record: TrainingRecord) -> CameraPose:
    """The pose in the middle of a training's range."""
    prior = session.get(PriorPoseRecord, record.prior_pose_id)
    assert prior is not None
    return replace(prior.pose, **(record.around or {}))


def camera_step_s(session: Session, camera_id: str) -> float:
    """The sampling step that a camera's newest tracks can offer."""
    newest = tracks.newest(session, camera_id, _STEP_TRACKS)
    if len(newest) < _STEP_TRACKS_NEEDED:
        return choose_step_s([])
    return choose_step_s([trajectory_of(track) for track in newest])


def is_wanted(session: Session, attempt: TrainingAttempt) -> bool:
    """True while a training is to go on: neither cancelled, deleted nor taken over."""
    record = _record_of(session, attempt)
    return record is not None and not record.cancel_requested


def report_progress(
    session: Session, attempt: TrainingAttempt, step: int, steps: int, loss: float, eta_s: float
) -> bool:
    """Write how far a training is; False tells the worker to stop."""
    record = _record_of(session, attempt)
    if record is None or record.cancel_requested:
        return False
    # Twenty events a training are enough for a progress bar.
    tells = steps > 0 and step * 20 // steps != record.step * 20 // steps
    record.step, record.steps, record.loss, record.eta_s = step, steps, loss, eta_s
    if tells:
        _tell(session, record)
    return True


def publish_model(
    session: Session,
    queue: JobQueue,
    attempt: TrainingAttempt,
    *,
    weights_sha256: str,
    metrics: dict[str, Any],
) -> None:
    """Put a whole, checked model to use, and look at the camera's tracks with it.

    Does nothing where the training was cancelled, taken over or deleted meanwhile.
    """
    record = _record_of(session, attempt)
    if record is None or record.state != TrainingState.RUNNING:
        return
    if record.cancel_requested:
        finish(session, record, TrainingState.CANCELLED)
        return
    session.add(
        ModelRecord(
            id=secrets.token_hex(16),
            camera_id=record.camera_id,
            prior_pose_id=record.prior_pose_id,
            training_id=record.id,
            weights_sha256=weights_sha256,
            config=plan_to_config(attempt.plan),
            seed=record.seed,
            step_s=attempt.plan.walk.step_s,
            metrics=metrics,
            created_at=datetime.now(UTC),
        )
    )
    record.metrics = metrics
    record.step, record.eta_s = record.steps, 0.0
    finish(session, record, TrainingState.SUCCEEDED)
    request_estimate(session, queue, record.camera_id)


def end_training(
    session: Session, attempt: TrainingAttempt, state: TrainingState, error: str | None = None
) -> None:
    """Mark this attempt as failed or cancelled; another attempt's record stays as it is."""
    record = _record_of(session, attempt)
    if record is not None and record.state == TrainingState.RUNNING:
        finish(session, record, state, error)


def _record_of(session: Session, attempt: TrainingAttempt) -> TrainingRecord | None:
    """The record of an attempt; None where it was deleted, or another attempt took it over."""
    record = session.get(TrainingRecord, attempt.training_id)
    return record if record is not None and record.attempt == attempt.attempt else None


def _stop(session: Session, record: TrainingRecord) -> None:
    record.cancel_requested = True
    if record.state == TrainingState.QUEUED:
        finish(session, record, TrainingState.CANCELLED)


def finish(
    session: Session, record: TrainingRecord, state: TrainingState, error: str | None = None
) -> None:
    """End a training, and tell of it."""
    record.state = state
    record.error = error
    record.finished_at = datetime.now(UTC)
    note(
        session,
        Activity(f"training.{state}"),
        by=None,
        camera_id=record.camera_id,
        subject_id=record.id,
        text=error,
    )
    _tell(session, record)


def _tell(session: Session, record: TrainingRecord) -> None:
    payload = {
        "id": record.id,
        "camera_id": record.camera_id,
        "state": record.state,
        "progress": {"step": record.step, "steps": record.steps, "loss": record.loss},
        "error": record.error,
    }
    journal.add_event(session, EventType.TRAINING, payload, datetime.now(UTC))
