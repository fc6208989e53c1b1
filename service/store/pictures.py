"""What the pictures of a camera tell: the gallery by light, and the newest one's result."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ForeignKey, Index, LargeBinary, String, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record, camera_key, foreign_key


class PictureReferenceRecord(Record):
    """A picture that others are compared with: its features, of which no picture can be made.

    The first of a prior pose is where the others' known turns begin.
    """

    __tablename__ = "picture_references"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    features: Mapped[bytes] = mapped_column(LargeBinary)

    __table_args__ = (Index(None, "camera_id", "id"),)


class PictureRecord(Record):
    """The result of a camera's newest picture, against the gallery of its prior pose.

    `offset` is how far it has turned from that, in tilt, roll and heading, with the covariance of
    the three; None where it matched none of the gallery, and `has_moved` is of the last that did.
    `shifted` says that it was moved aside, too. `digest` is of its pixels, which were the same
    since `same_since`. `other_at` is when the newest picture was taken by which it was the other
    way round: stood, or had moved.
    `agreement` counts pictures by what they say and people say beside them: `stood/moved` are those
    of a camera that stood by the picture and moved by people. `unmatched` are features of a picture
    since the last one that matched, with which it stood. `stood_jpeg` is the newest picture by
    which it stood, where pictures are kept.
    """

    __tablename__ = "pictures"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    taken_at: Mapped[datetime]
    stored_at: Mapped[datetime]
    digest: Mapped[str] = mapped_column(String(64))
    same_since: Mapped[datetime]
    offset: Mapped[list[Any] | None] = mapped_column("turn", JSON(none_as_null=True))
    covariance: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    zoom: Mapped[float | None]
    zoom_sd: Mapped[float | None]
    shifted: Mapped[bool]
    has_moved: Mapped[bool | None]
    other_at: Mapped[datetime | None]
    agreement: Mapped[dict[str, Any]] = mapped_column(default=dict)
    unmatched: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    stood_jpeg: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    stood_at: Mapped[datetime | None]

    @property
    def unchanged_s(self) -> float:
        """For how long all pictures have been this one, to the last pixel."""
        return (self.taken_at - self.same_since).total_seconds()


def gallery(session: Session, prior_pose_id: int) -> Sequence[PictureReferenceRecord]:
    """The gallery of a prior pose, the first one first."""
    return session.scalars(
        select(PictureReferenceRecord)
        .where(PictureReferenceRecord.prior_pose_id == prior_pose_id)
        .order_by(PictureReferenceRecord.id)
    ).all()


def unmatched(session: Session, camera_id: str) -> bytes | None:
    """The features of a picture that matched nothing since the last that did."""
    return session.scalar(
        select(PictureRecord.unmatched).where(PictureRecord.camera_id == camera_id)
    )


def forget(session: Session, camera_id: str) -> None:
    """Delete all that pictures have told of a camera."""
    for record in (PictureReferenceRecord, PictureRecord):
        session.execute(delete(record).where(record.camera_id == camera_id))


def note_agreement(session: Session, camera_id: str, *, people_moved: bool) -> None:
    """Count what people say beside the newest picture of a camera."""
    record = session.get(PictureRecord, camera_id)
    if record is not None and record.has_moved is not None:
        named = "/".join("moved" if each else "stood" for each in (record.has_moved, people_moved))
        record.agreement = record.agreement | {named: record.agreement.get(named, 0) + 1}


def agreement(session: Session) -> Counter[str]:
    """The counts of all cameras."""
    found: Counter[str] = Counter()
    for counts in session.scalars(select(PictureRecord.agreement)):
        found.update(counts)
    return found


def keep_only(session: Session, camera_id: str, ids: Sequence[int]) -> None:
    """Delete what is of no use any more in a camera's gallery."""
    kept = PictureReferenceRecord.id.in_(ids)
    session.execute(
        delete(PictureReferenceRecord).where(PictureReferenceRecord.camera_id == camera_id, ~kept)
    )
