"""Bodies of trainings."""

import math
from datetime import datetime
from typing import Any, Literal, Self

from pydantic import BaseModel, Field

from service.api.schemas.base import Body, Who
from service.enums import TrainingState
from service.store.tables.trainings import TrainingRecord


class TrainingBody(Body):
    """A training to queue; without a recipe, the service's."""

    recipe: Literal["default", "paper"] | None = None
    seed: int | None = Field(None, ge=0, lt=2**31)
    by: Who | None = None


class ProgressOut(BaseModel):
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


class TrainingOut(BaseModel):
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
        return cls(
            id=record.id,
            camera_id=record.camera_id,
            state=record.state,
            recipe=record.recipe,
            seed=record.seed,
            around=None
            if record.around is None
            else CentreOut(
                height_m=record.around["height_m"],
                tilt_deg=math.degrees(record.around["tilt_rad"]),
                roll_deg=math.degrees(record.around["roll_rad"]),
            ),
            progress=ProgressOut(
                step=record.step, steps=record.steps, loss=record.loss, eta_s=record.eta_s
            ),
            queued_at=record.queued_at,
            started_at=record.started_at,
            finished_at=record.finished_at,
            error=record.error,
            metrics=record.metrics,
        )


class TrainingList(BaseModel):
    """Trainings, newest first."""

    items: list[TrainingOut]
