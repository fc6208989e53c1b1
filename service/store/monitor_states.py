"""The monitor's state of each camera: scores of the tracks of its window."""

from typing import NamedTuple

from sqlalchemy import (
    ForeignKey,
    Integer,
    LargeBinary,
    String,
    bindparam,
    delete,
    func,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.cameras import SnapshotRecord
from service.store.pictures import PictureRecord
from service.store.record import Record, newest_first
from service.store.references import FlowMapRecord
from service.store.trainings import ModelRecord


class MonitorStateRecord(Record):
    """Scores of the tracks of a camera's window (`models.assessment.scored_tracks`).

    `scored` are those of the last run that scored the whole window, `newer` those of later tracks;
    `context` are values of the whole window. `basis` is a digest of what they depend on beside the
    tracks: with another one they are of no use. `tracks_a_year` was the rate of tracks.
    """

    __tablename__ = "monitor_states"

    camera_id: Mapped[str] = mapped_column(
        String(64), ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    basis: Mapped[bytes] = mapped_column(LargeBinary)
    tracks_a_year: Mapped[float]
    context: Mapped[bytes] = mapped_column(LargeBinary)
    scored: Mapped[bytes] = mapped_column(LargeBinary)
    newer: Mapped[bytes] = mapped_column(LargeBinary)


class Inputs(NamedTuple):
    """Versions of the inputs of a camera's runs beside its tracks; None where there is none.

    `snapshot_waits` is 1 if an image was not compared yet.
    """

    map_learned_at: str | None
    model_id: str | None
    picture_stored_at: str | None
    snapshot_waits: int | None


_CAMERA = bindparam("camera", type_=String)
_REFERENCE = bindparam("reference_pk", type_=Integer)
_MODEL = newest_first(ModelRecord, _CAMERA, ModelRecord.created_at).limit(1)
# Built once: every run of a camera asks for it.
_INPUTS = select(
    select(FlowMapRecord.learned_at)
    .where(FlowMapRecord.reference_id == _REFERENCE)
    .scalar_subquery(),
    _MODEL.with_only_columns(ModelRecord.id).scalar_subquery(),
    select(PictureRecord.stored_at).where(PictureRecord.camera_id == _CAMERA).scalar_subquery(),
    select(func.count())
    .where(SnapshotRecord.camera_id == _CAMERA, SnapshotRecord.compared_at.is_(None))
    .scalar_subquery(),
)
_NEWER = (
    update(MonitorStateRecord.__table__)  # type: ignore[arg-type]
    .where(MonitorStateRecord.camera_id == _CAMERA, MonitorStateRecord.basis == bindparam("of"))
    .values(newer=bindparam("scores"))
)


def inputs(session: Session, camera_id: str, reference_id: int) -> Inputs:
    """Versions of the inputs of a camera."""
    values = {"camera": camera_id, "reference_pk": reference_id}
    return Inputs._make(session.execute(_INPUTS, values).one())


def keep_newer(session: Session, camera_id: str, basis: bytes, newer: bytes) -> None:
    """Store the scores of newer tracks, unless the state was replaced meanwhile."""
    session.execute(_NEWER, {"camera": camera_id, "of": basis, "scores": newer})


def forget(session: Session, camera_id: str | None = None) -> None:
    """Delete the state of a camera whose stored tracks change; of all cameras if none is named."""
    query = delete(MonitorStateRecord)
    if camera_id is not None:
        query = query.where(MonitorStateRecord.camera_id == camera_id)
    session.execute(query)
