"""Trainings that begin by themselves: the first, one at the edge of a range, a lost one again."""

import math
import time
from dataclasses import replace

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from service.enums import TrainingState
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import cameras, trainings
from service.store.cameras import CameraRecord
from service.store.trainings import TrainingRecord
from service.training.trainings import camera_step_s, centre_of, finish, queue_training

_EDGE = 0.9  # of the training range: beyond, a regressor only knows "at least so much"
_SAME_RAD, _SAME_M = math.radians(5.0), 1.0
# A model reads tracks at another step than its own, but less well the farther they are apart.
_STEP_RATIO = 1.3
_STEP_KNOWN_FOR_S = 600.0
_ATTEMPTS = 10  # at a training that never comes to an end by itself


class StepWatch:
    """Remembers the steps that tracks offer: they are read out of 200 tracks, and hardly change."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, float]] = {}

    def fits(self, session: Session, camera_id: str, model_step_s: float) -> bool:
        """True where a model of a step suits a camera's tracks, by what they were 10 minutes ago.

        What does not suit is asked anew.
        """
        asked_s, step_s = self._known.get(camera_id, (-_STEP_KNOWN_FOR_S, 0.0))
        now_s = time.monotonic()
        if now_s - asked_s >= _STEP_KNOWN_FOR_S or not _suits(step_s, model_step_s):
            step_s = camera_step_s(session, camera_id)
            self._known[camera_id] = now_s, step_s
        return _suits(step_s, model_step_s)


def train_by_itself(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    around: CameraPose | None = None,
) -> TrainingRecord | None:
    """Queue a training that nobody asked for; none where the settings want none."""
    if settings.trainings == "off":
        return None
    return queue_training(session, queue, settings, camera_id, around=around)


def train_if_needed(
    session: Session, queue: JobQueue, settings: Settings, camera: CameraRecord, steps: StepWatch
) -> str | None:
    """Queue a training where a camera has no model that suits it; says why, if it did."""
    if settings.trainings == "off":
        return None
    reason = _why_train(session, camera, steps)
    if reason is not None:
        queue_training(session, queue, settings, camera.id)
    return reason


def train_at_edge(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    pose: CameraPose,
    identifiable: tuple[str, ...],
) -> None:
    """Have a model trained around a pose at the edge of its range, unless one was or will be."""
    if not _is_beyond(session, camera_id, pose, identifiable):
        return
    if trainings.unfinished(session, camera_id):
        return
    newest = trainings.of_camera(session, camera_id, 1)
    if newest and _is_near(centre_of(session, newest[0]), pose):
        return
    train_by_itself(session, queue, settings, camera_id, around=pose)


def requeue_lost(session: Session, queue: JobQueue, camera_id: str) -> bool:
    """Queue those of a camera's trainings again that the engine has lost; whether there were any.

    One that has been taken up again and again fails instead.
    """
    found = False
    for record in trainings.unfinished(session, camera_id):
        if not queue.requeue_training(session, camera_id, record.id):
            continue
        found = True
        if record.attempt >= _ATTEMPTS:
            given_up = f"given up after {record.attempt} attempts"
            finish(session, record, TrainingState.FAILED, given_up)
    return found


def _why_train(session: Session, camera: CameraRecord, steps: StepWatch) -> str | None:
    if trainings.unfinished(session, camera.id):
        return None
    prior = cameras.prior_pose(session, camera.id)
    if prior.assumed:
        return None
    ended_in_vain = (TrainingState.FAILED, TrainingState.CANCELLED)
    for newest in trainings.of_camera(session, camera.id, 1):
        if newest.prior_pose_id == prior.id and newest.state in ended_in_vain:
            return None  # trying the same again needs a person, or another prior pose
    model = trainings.newest_model(session, camera.id)
    if model is None:
        return "camera without a model"
    if model.prior_pose_id != prior.id:
        return "model older than the prior pose"
    if not steps.fits(session, camera.id, model.step_s):
        return "model of another sampling step than the tracks offer"
    return None


def _suits(step_s: float, other_s: float) -> bool:
    return 1 / _STEP_RATIO < step_s / other_s < _STEP_RATIO


def _is_beyond(
    session: Session, camera_id: str, pose: CameraPose, identifiable: tuple[str, ...]
) -> bool:
    model = trainings.newest_model(session, camera_id)
    if model is None:
        return False
    centre, spread = model.config["prior_pose"], model.config["recipe"]["spread"]
    roll_rad = math.remainder(pose.roll_rad - centre["roll_rad"], 2 * math.pi)
    shares = {
        "height": (pose.height_m - centre["height_m"]) / spread["height_m"],
        "tilt": (pose.tilt_rad - centre["tilt_rad"]) / spread["angle_rad"],
        "roll": roll_rad / spread["angle_rad"],
    }
    return any(name in identifiable and abs(share) > _EDGE for name, share in shares.items())


def _is_near(centre: CameraPose, pose: CameraPose) -> bool:
    # A model knows nothing of the heading: a pan asks for no other training.
    level = replace(pose, heading_rad=centre.heading_rad)
    apart_rad = angle_between(centre.quaternion_wxyz, level.quaternion_wxyz)
    return bool(apart_rad <= _SAME_RAD) and abs(centre.height_m - pose.height_m) <= _SAME_M
