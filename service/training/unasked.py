"""Trainings that begin by themselves."""

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from service.job_queue import JobQueue
from service.settings import Settings
from service.store.trainings import TrainingRecord
from service.training.trainings import queue_training


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
