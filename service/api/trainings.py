"""Trainings: queue, list, show, cancel."""

from datetime import datetime
from typing import Annotated, Any, Literal, Self

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field

from service import training
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.schemas import Body, Out, Who
from service.degrees import in_degrees
from service.enums import TrainingState
from service.store.access import name_in
from service.store.trainings import TrainingRecord


class TrainingBody(Body):
    """A training to queue; without a recipe, the service's."""

    recipe: Literal["default", "paper"] | None = None
    seed: int | None = Field(None, ge=0, lt=2**31)
    by: Who | None = None


class ProgressOut(Out):
    """How far a training is."""

    step: int
    steps: int
    loss: float | None
    eta_s: float | None


class CentreOut(BaseModel):
    """The pose that a training is centred on, where it is not the prior pose."""

    height_m: float
    tilt_deg: float
    roll_deg: float


class TrainingOut(Out):
    """A training."""

    id: str
    camera_id: str
    state: TrainingState
    recipe: str
    seed: int
    around: CentreOut | None
    progress: ProgressOut
    queued_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    error: str | None
    metrics: dict[str, Any] | None

    @classmethod
    def from_record(cls, record: TrainingRecord) -> Self:
        """The body of a stored training."""
        around = record.around and CentreOut(**in_degrees(record.around))
        return cls.of(record, around=around, progress=record)


class TrainingList(BaseModel):
    """Trainings, newest first."""

    items: list[TrainingOut]


router = APIRouter(tags=["trainings"], route_class=NamingRoute)


@router.post("/cameras/{camera_id}/trainings", status_code=202)
def start_training(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    body: TrainingBody | None = None,
) -> TrainingOut:
    """Queue a training at the prior pose of a camera."""
    body = body or TrainingBody()
    by = name_in(session, body.by)
    record = training.request_training(
        session, state.queue, state.settings, camera_id, body.recipe, body.seed, by
    )
    return TrainingOut.from_record(record)


@router.get("/cameras/{camera_id}/trainings")
def list_trainings(
    camera_id: str, session: ReadDep, limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> TrainingList:
    """List the trainings of a camera, newest first."""
    records = training.list_trainings(session, camera_id, limit)
    return TrainingList(items=[TrainingOut.from_record(record) for record in records])


@router.get("/trainings/{training_id}")
def get_training(training_id: str, session: ReadDep) -> TrainingOut:
    """Get a training with its progress."""
    return TrainingOut.from_record(training.show_training(session, training_id))


@router.delete("/trainings/{training_id}", status_code=202)
def cancel_training(training_id: str, session: WriteDep) -> TrainingOut:
    """Cancel a training.

    A queued one ends at once, a running one within a second or so.
    """
    return TrainingOut.from_record(training.cancel_training(session, training_id))
