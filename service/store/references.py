"""Statements on references."""

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.store.tables import SiteReferenceRecord


def newest(session: Session, camera_id: str) -> SiteReferenceRecord:
    """The reference of a camera that counts."""
    return session.scalars(_newest(camera_id)).one()


def newest_if_any(session: Session, camera_id: str) -> SiteReferenceRecord | None:
    """The reference that counts; None where the camera is gone."""
    return session.scalars(_newest(camera_id)).first()


def _newest(camera_id: str) -> Select[SiteReferenceRecord]:
    return (
        select(SiteReferenceRecord)
        .where(SiteReferenceRecord.camera_id == camera_id)
        .order_by(SiteReferenceRecord.id.desc())
        .limit(1)
    )
