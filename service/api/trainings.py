"""Trainings: queue, list, show, cancel."""

from typing import Annotated

from fastapi import APIRouter, Query

from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.api.schemas.cameras.trainings import TrainingBody, TrainingList, TrainingOut
from service.training import trainings

router = APIRouter(tags=["trainings"])


@router.post("/cameras/{camera_id}/trainings", status_code=202)
def request(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    actor: ActorDep,
    body: TrainingBody | None = None,
) -> TrainingOut:
    """Queue a training at the camera's prior pose."""
    body = body or TrainingBody()
    by = name_of(actor, body.by)
    record = trainings.request_training(
        session, state.queue, state.settings, camera_id, body.recipe, body.seed, by
    )
    return TrainingOut.from_record(record)


@router.get("/cameras/{camera_id}/trainings")
def list_all(
    camera_id: str, session: ReadDep, limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> TrainingList:
    """A camera's trainings, newest first."""
    records = trainings.list_trainings(session, camera_id, limit)
    return TrainingList(items=[TrainingOut.from_record(record) for record in records])


@router.get("/trainings/{training_id}")
def show(training_id: str, session: ReadDep) -> TrainingOut:
    """A training with its progress."""
    return TrainingOut.from_record(trainings.show_training(session, training_id))


@router.delete("/trainings/{training_id}", status_code=202)
def cancel(training_id: str, session: WriteDep) -> TrainingOut:
    """Cancel a training: a queued one at once, a running one within a second or so."""
    return TrainingOut.from_record(trainings.cancel_training(session, training_id))
