"""Another training, once a camera stands at the edge of what its model was trained for."""

import math
from dataclasses import replace

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import trainings
from service.training.trainings import centre_of
from service.training.unasked import train_by_itself

_EDGE = 0.9  # of the training range: beyond, a regressor only knows "at least so much"
_SAME_RAD = math.radians(5.0)
_SAME_M = 1.0


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
    return apart_rad <= _SAME_RAD and abs(centre.height_m - pose.height_m) <= _SAME_M
