"""Statements on references."""

from collections.abc import Sequence

from sqlalchemy import Select, select
from sqlalchemy.orm import Session, defer

from service.store.tables import SiteReferenceRecord


def newest(session: Session, camera_id: str) -> SiteReferenceRecord:
    """The reference of a camera that counts."""
    return session.scalars(_newest(camera_id)).one()


def newest_if_any(session: Session, camera_id: str) -> SiteReferenceRecord | None:
    """The reference that counts; None where the camera is gone."""
    return session.scalars(_newest(camera_id)).first()


def of_camera(session: Session, camera_id: str, limit: int) -> Sequence[SiteReferenceRecord]:
    """The references of a camera, newest first, without what was learned."""
    return session.scalars(
        select(SiteReferenceRecord)
        .where(SiteReferenceRecord.camera_id == camera_id)
        .order_by(SiteReferenceRecord.id.desc())
        .limit(limit)
        .options(defer(SiteReferenceRecord.data))
    ).all()


def _newest(camera_id: str) -> Select[SiteReferenceRecord]:
    return (
        select(SiteReferenceRecord)
        .where(SiteReferenceRecord.camera_id == camera_id)
        .order_by(SiteReferenceRecord.id.desc())
        .limit(1)
    )
