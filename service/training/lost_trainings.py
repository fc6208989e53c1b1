"""Trainings whose job the engine has lost."""

from sqlalchemy.orm import Session

from service.enums import TrainingState
from service.job_queue import JobQueue
from service.store import trainings
from service.training.trainings import finish

_ATTEMPTS = 10  # at a training that never comes to an end by itself


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
            finish(
                session, record, TrainingState.FAILED, f"given up after {record.attempt} attempts"
            )
    return found
