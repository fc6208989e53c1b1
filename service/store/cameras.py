"""Statements on cameras and their prior poses."""

from collections.abc import Sequence

from sqlalchemy import bindparam, delete, func, select
from sqlalchemy.orm import Session

from service.store.tables.cameras import CameraRecord, PriorPoseRecord
from service.store.tables.estimates import EstimateRecord
from service.store.tables.references import SiteReferenceRecord
from service.store.tables.trainings import ModelRecord, TrainingRecord

# Built once: each request for a pose asks for it.
_PRIOR_POSE = (
    select(PriorPoseRecord)
    .where(PriorPoseRecord.camera_id == bindparam("camera"))
    .order_by(PriorPoseRecord.id.desc())
    .limit(1)
)


def find(session: Session, camera_id: str) -> CameraRecord | None:
    """The camera, or None."""
    return session.get(CameraRecord, camera_id)


def page(session: Session, after_id: str, limit: int) -> Sequence[CameraRecord]:
    """Cameras in order of their ids, after one."""
    query = select(CameraRecord).where(CameraRecord.id > after_id)
    return session.scalars(query.order_by(CameraRecord.id).limit(limit)).all()


def every(session: Session) -> Sequence[CameraRecord]:
    """All cameras."""
    return session.scalars(select(CameraRecord).order_by(CameraRecord.id)).all()


def ids(session: Session) -> Sequence[str]:
    """The ids of all cameras, in order."""
    return session.scalars(select(CameraRecord.id).order_by(CameraRecord.id)).all()


def count(session: Session) -> int:
    """How many cameras there are."""
    return session.scalar(select(func.count()).select_from(CameraRecord)) or 0


def prior_pose(session: Session, camera_id: str) -> PriorPoseRecord:
    """The pose that a camera is trusted to have had last."""
    return session.scalars(_PRIOR_POSE, {"camera": camera_id}).one()


def prior_poses(session: Session, camera_id: str, limit: int) -> Sequence[PriorPoseRecord]:
    """The poses that a camera was trusted to have, newest first."""
    return session.scalars(
        select(PriorPoseRecord)
        .where(PriorPoseRecord.camera_id == camera_id)
        .order_by(PriorPoseRecord.id.desc())
        .limit(limit)
    ).all()


def forget_poses(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many that nothing names; how many."""
    surplus = (
        select(PriorPoseRecord.id)
        .where(PriorPoseRecord.camera_id == camera_id)
        .order_by(PriorPoseRecord.id.desc())
        .offset(keep)
    )
    naming = (SiteReferenceRecord, TrainingRecord, ModelRecord, EstimateRecord)
    named = [select(one.prior_pose_id).where(one.camera_id == camera_id) for one in naming]
    bite = (
        select(PriorPoseRecord.id)
        .where(
            PriorPoseRecord.id.in_(surplus),
            *(PriorPoseRecord.id.not_in(query) for query in named),
        )
        .limit(limit)
    )
    result = session.execute(delete(PriorPoseRecord).where(PriorPoseRecord.id.in_(bite)))
    return int(result.rowcount)  # type: ignore[attr-defined]


def due(session: Session) -> Sequence[CameraRecord]:
    """Cameras that are to be looked at, those first that have been due for longest."""
    return session.scalars(
        select(CameraRecord)
        .where(CameraRecord.estimate_due_at.is_not(None))
        .order_by(CameraRecord.estimate_due_at, CameraRecord.id)
    ).all()


def failing(session: Session) -> Sequence[CameraRecord]:
    """Cameras whose last look failed."""
    return session.scalars(
        select(CameraRecord)
        .where(CameraRecord.estimate_failing_since.is_not(None))
        .order_by(CameraRecord.estimate_failing_since, CameraRecord.id)
    ).all()
