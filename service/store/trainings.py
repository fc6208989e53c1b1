"""Trainings, the models that they made, and their weights."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Index, LargeBinary, String, bindparam, func, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.enums import TrainingState
from service.store.record import Record, camera_key, delete_some, foreign_key, newest_first, surplus


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


UNFINISHED = (TrainingState.QUEUED, TrainingState.RUNNING)

# Built once, which takes longer than to run them: each request for a pose asks for the one, and
# each reconcile of a camera for the others.
_CAMERA = bindparam("camera", type_=String)
_NEWEST_MODEL = newest_first(ModelRecord, _CAMERA, ModelRecord.created_at).limit(1)
_OF_CAMERA = newest_first(TrainingRecord, _CAMERA, TrainingRecord.queued_at).limit(
    bindparam("most")
)
_UNFINISHED_OF_CAMERA = (
    select(TrainingRecord)
    .where(TrainingRecord.camera_id == _CAMERA, TrainingRecord.state.in_(UNFINISHED))
    .order_by(TrainingRecord.queued_at)
)


def count_by_state(session: Session) -> dict[TrainingState, int]:
    """The number of stored trainings in each state."""
    query = select(TrainingRecord.state, func.count()).group_by(TrainingRecord.state)
    return {state: count for state, count in session.execute(query)}


def of_camera(session: Session, camera_id: str, limit: int) -> Sequence[TrainingRecord]:
    """A camera's trainings, newest first."""
    return session.scalars(_OF_CAMERA, {"camera": camera_id, "most": limit}).all()


def unfinished(session: Session, camera_id: str) -> Sequence[TrainingRecord]:
    """A camera's queued and running trainings, oldest first."""
    return session.scalars(_UNFINISHED_OF_CAMERA, {"camera": camera_id}).all()


def newest_model(session: Session, camera_id: str) -> ModelRecord | None:
    """The model in use of a camera, or None."""
    return session.scalars(_NEWEST_MODEL, {"camera": camera_id}).first()


def forget_models(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of a camera's models but its newest so many; how many."""
    superseded = surplus(ModelRecord, camera_id, keep, ModelRecord.created_at)
    return delete_some(session, ModelRecord.id, superseded.limit(limit))


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but a camera's newest so many; how many.

    Those stay that have a model or have not ended.
    """
    beyond = surplus(TrainingRecord, camera_id, keep, TrainingRecord.queued_at)
    bite = (
        select(TrainingRecord.id)
        .where(
            TrainingRecord.id.in_(beyond),
            TrainingRecord.state.not_in(UNFINISHED),
            TrainingRecord.id.not_in(select(ModelRecord.training_id)),
        )
        .limit(limit)
    )
    return delete_some(session, TrainingRecord.id, bite)


def weights_in_use(session: Session) -> set[str]:
    """Hashes of all weights that a model names."""
    return set(session.scalars(select(ModelRecord.weights_sha256)))


def forget_weights(session: Session, limit: int) -> int:
    """Delete up to `limit` of the weights that no model names. Returns how many."""
    unused = WeightsRecord.sha256.not_in(select(ModelRecord.weights_sha256))
    bite = select(WeightsRecord.sha256).where(unused).limit(limit)
    return delete_some(session, WeightsRecord.sha256, bite)
