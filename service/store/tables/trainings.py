"""Records of trainings and the models that they made."""

from datetime import datetime
from typing import Any

from sqlalchemy import Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.enums import (
    TrainingState,
)
from service.store.tables.base import camera_key, foreign_key
from service.store.tables.record import Record, one_of


class TrainingRecord(Record):
    """One training run; `attempt` grows each time a worker takes it up.

    `around` has the height, tilt and roll that it is centred on, where these are not the prior's.
    """

    __tablename__ = "trainings"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = camera_key()
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    recipe: Mapped[str]
    around: Mapped[dict[str, Any] | None]
    seed: Mapped[int]
    state: Mapped[TrainingState]
    attempt: Mapped[int]
    cancel_requested: Mapped[bool]
    step: Mapped[int]
    steps: Mapped[int]
    loss: Mapped[float | None]
    eta_s: Mapped[float | None]
    error: Mapped[str | None]
    metrics: Mapped[dict[str, Any] | None]
    queued_at: Mapped[datetime]
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("state", TrainingState),
        Index(None, "camera_id", "queued_at"),
        Index(None, "state"),
    )


class ModelRecord(Record):
    """A published model; its weights are the file `<weights_sha256>.safetensors`.

    On a server, whose workers have no disk in common, a `WeightsRecord` has them, too.
    """

    __tablename__ = "models"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = camera_key()
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    training_id: Mapped[str] = foreign_key("trainings.id", unique=True)
    weights_sha256: Mapped[str] = mapped_column(String(64))
    config: Mapped[dict[str, Any]]
    seed: Mapped[int]
    step_s: Mapped[float]
    metrics: Mapped[dict[str, Any]]
    created_at: Mapped[datetime]

    __table_args__ = (Index(None, "camera_id", "created_at"),)


class WeightsRecord(Record):
    """The weights of models by their hash, where several machines share a database."""

    __tablename__ = "weights"

    sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    data: Mapped[bytes] = mapped_column(LargeBinary)
    stored_at: Mapped[datetime]
