"""Statements on trainings and models."""

from collections.abc import Sequence
from datetime import UTC, datetime

from sqlalchemy import bindparam, select
from sqlalchemy.orm import Session

from service.enums import TrainingState
from service.store.database.deleting import delete_some
from service.store.tables.trainings import ModelRecord, TrainingRecord, WeightsRecord

UNFINISHED = (TrainingState.QUEUED, TrainingState.RUNNING)

# Built once, which takes longer than to run them: each request for a pose asks for the one, and
# each reconcile of a camera for the others.
_NEWEST_MODEL = (
    select(ModelRecord)
    .where(ModelRecord.camera_id == bindparam("camera"))
    .order_by(ModelRecord.created_at.desc())
    .limit(1)
)
_OF_CAMERA = (
    select(TrainingRecord)
    .where(TrainingRecord.camera_id == bindparam("camera"))
    .order_by(TrainingRecord.queued_at.desc())
    .limit(bindparam("most"))
)
_UNFINISHED_OF_CAMERA = (
    select(TrainingRecord)
    .where(TrainingRecord.camera_id == bindparam("camera"), TrainingRecord.state.in_(UNFINISHED))
    .order_by(TrainingRecord.queued_at)
)


def find(session: Session, training_id: str) -> TrainingRecord | None:
    """The training, or None."""
    return session.get(TrainingRecord, training_id)


def of_camera(session: Session, camera_id: str, limit: int) -> Sequence[TrainingRecord]:
    """A camera's trainings, newest first."""
    return session.scalars(_OF_CAMERA, {"camera": camera_id, "most": limit}).all()


def unfinished(session: Session, camera_id: str) -> Sequence[TrainingRecord]:
    """A camera's queued and running trainings, oldest first."""
    return session.scalars(_UNFINISHED_OF_CAMERA, {"camera": camera_id}).all()


def newest_model(session: Session, camera_id: str) -> ModelRecord | None:
    """The model in use of a camera, or None."""
    return session.scalars(_NEWEST_MODEL, {"camera": camera_id}).first()


def superseded_models(session: Session, camera_id: str, keep: int) -> Sequence[ModelRecord]:
    """Models of a camera older than its newest so many."""
    return session.scalars(
        select(ModelRecord)
        .where(ModelRecord.camera_id == camera_id)
        .order_by(ModelRecord.created_at.desc())
        .offset(keep)
    ).all()


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but a camera's newest so many; how many.

    Those stay that have a model or have not ended.
    """
    surplus = (
        select(TrainingRecord.id)
        .where(TrainingRecord.camera_id == camera_id)
        .order_by(TrainingRecord.queued_at.desc())
        .offset(keep)
    )
    bite = (
        select(TrainingRecord.id)
        .where(
            TrainingRecord.id.in_(surplus),
            TrainingRecord.state.not_in(UNFINISHED),
            TrainingRecord.id.not_in(select(ModelRecord.training_id)),
        )
        .limit(limit)
    )
    return delete_some(session, TrainingRecord.id, bite)


def weights_in_use(session: Session) -> set[str]:
    """Hashes of all weights that a model names."""
    return set(session.scalars(select(ModelRecord.weights_sha256)))


def has_weights(session: Session, sha256: str) -> bool:
    """Whether weights are in the database."""
    return session.scalar(select(WeightsRecord.sha256).filter_by(sha256=sha256)) is not None


def weights(session: Session, sha256: str) -> bytes | None:
    """Weights by their hash; None where they are not in the database."""
    return session.scalar(select(WeightsRecord.data).filter_by(sha256=sha256))


def keep_weights(session: Session, sha256: str, data: bytes) -> None:
    """Put weights into the database."""
    session.add(WeightsRecord(sha256=sha256, data=data, stored_at=datetime.now(UTC)))


def forget_weights(session: Session, limit: int) -> int:
    """Delete up to `limit` of the weights that no model names. Returns how many."""
    unused = WeightsRecord.sha256.not_in(select(ModelRecord.weights_sha256))
    bite = select(WeightsRecord.sha256).where(unused).limit(limit)
    return delete_some(session, WeightsRecord.sha256, bite)


def model_exists(session: Session, model_id: str) -> bool:
    """Whether a model is still stored."""
    return session.get(ModelRecord, model_id) is not None


def delete_model(session: Session, model_id: str) -> None:
    """Delete a model and what it says of tracks."""
    record = session.get(ModelRecord, model_id)
    if record is not None:
        session.delete(record)
