"""The range that a model was trained for: what leaves it, and the training that then helps."""

import math
from dataclasses import replace

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from models.reasons import Reason
from service.job_queue import JobQueue
from service.reasons import ServiceCode
from service.settings import Settings
from service.store import trainings
from service.store.tables.trainings import TrainingRecord
from service.training.trainings import centre_of
from service.training.unasked import train_by_itself

_EDGE = 0.9  # of the training range: beyond, a regressor only knows "at least so much"
_SAME_RAD = math.radians(5.0)
_SAME_M = 1.0


def beyond_range(
    session: Session, camera_id: str, pose: CameraPose, identifiable: tuple[str, ...]
) -> Reason | None:
    """Which identifiable parameter is at the edge of what the model in use was trained for."""
    model = trainings.newest_model(session, camera_id)
    if model is None:
        return None
    centre, spread = model.config["prior_pose"], model.config["recipe"]["spread"]
    offsets = {
        "height": (pose.height_m - centre["height_m"], spread["height_m"]),
        "tilt": (pose.tilt_rad - centre["tilt_rad"], spread["angle_rad"]),
        "roll": (
            math.remainder(pose.roll_rad - centre["roll_rad"], 2 * math.pi),
            spread["angle_rad"],
        ),
    }
    for name, (offset, reach) in offsets.items():
        if name in identifiable and abs(offset) > _EDGE * reach:
            return Reason(code=ServiceCode.RANGE_EDGE, values={"number": name})
    return None


def train_around(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, pose: CameraPose
) -> Reason | None:
    """Have a model trained around a pose, if none was; says what became of it, if one is."""
    unfinished = trainings.unfinished(session, camera_id)
    if unfinished:
        return _around(unfinished[-1])
    newest = trainings.of_camera(session, camera_id, 1)
    if newest:
        centre = centre_of(session, newest[0])
        # A model knows nothing of the heading: a pan asks for no other training.
        level = replace(pose, heading_rad=centre.heading_rad)
        apart = angle_between(centre.quaternion_wxyz, level.quaternion_wxyz)
        if apart <= _SAME_RAD and abs(centre.height_m - pose.height_m) <= _SAME_M:
            return _around(newest[0])
    queued = train_by_itself(session, queue, settings, camera_id, around=pose)
    return None if queued is None else _around(queued)


def _around(training: TrainingRecord) -> Reason:
    return Reason(code=ServiceCode.TRAINING_AROUND, values={"state": training.state})
