"""Statements on references."""

from collections.abc import Sequence

from sqlalchemy import Connection, Select, bindparam, exists, func, select, update
from sqlalchemy.orm import Session, aliased, defer

from service.store.database.deleting import delete_some
from service.store.tables.estimates import EstimateRecord
from service.store.tables.references import SiteReferenceRecord

_Reference = aliased(SiteReferenceRecord)
_NEWEST_OF_ONE = select(func.max(_Reference.id)).where(_Reference.camera_id == bindparam("camera"))
_OF_SOURCE = (
    update(SiteReferenceRecord.__table__)  # type: ignore[arg-type]
    .where(
        SiteReferenceRecord.id == _NEWEST_OF_ONE.scalar_subquery(),
        SiteReferenceRecord.source.is_(None),
    )
    .values(source=bindparam("name"))
)


def be_of_source(connection: Connection, camera_id: str, name: str) -> None:
    """Have the reference that counts be of a source, if it is of none yet."""
    connection.execute(_OF_SOURCE, {"camera": camera_id, "name": name})


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


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many that no estimate names; how many."""
    surplus = (
        select(SiteReferenceRecord.id)
        .where(SiteReferenceRecord.camera_id == camera_id)
        .order_by(SiteReferenceRecord.id.desc())
        .offset(keep)
    )
    named = exists().where(EstimateRecord.reference_id == SiteReferenceRecord.id)
    of_camera = EstimateRecord.camera_id == camera_id  # by its index
    bite = (
        select(SiteReferenceRecord.id)
        .where(SiteReferenceRecord.id.in_(surplus), ~named.where(of_camera))
        .limit(limit)
    )
    return delete_some(session, SiteReferenceRecord.id, bite)


def _newest(camera_id: str) -> Select[SiteReferenceRecord]:
    return (
        select(SiteReferenceRecord)
        .where(SiteReferenceRecord.camera_id == camera_id)
        .order_by(SiteReferenceRecord.id.desc())
        .limit(1)
    )
