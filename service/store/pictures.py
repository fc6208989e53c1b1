"""What the pictures of a camera tell: the gallery by light, and the newest one's result."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import JSON, ForeignKey, Index, LargeBinary, String, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from models.geometry.pose import ANGLES
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
    """The result of a camera's newest image, against the gallery of its prior pose.

    `offset` is the turn since that pose in tilt, roll and heading, with the covariance of the three
    and the `inliers` of the match; None if it matched no reference. `earlier` has the same of the
    images before it that matched, each with `taken_s`, the newest first. `compared` counts all
    images since the first of the gallery, whether or not they matched.
    `has_moved` is by the last image that matched. `shifted`: the camera was moved aside, too.
    `digest` is of the pixels, which have been the same since `same_since`. `other_at` is when the
    newest image was taken by which `has_moved` was the other way round.
    `agreement` counts images by what they and the tracks beside them indicate: `stood/moved` are
    those of a camera that had not moved by the image, and had by its tracks. `unmatched` are
    features of an image since the last one that matched, and by which the camera had not moved.
    `stood_jpeg` is the newest image by which it had not moved, if images are kept.
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
    inliers: Mapped[int | None]
    compared: Mapped[int] = mapped_column(default=0)
    earlier: Mapped[list[Any]] = mapped_column(JSON, default=list)

    @property
    def unchanged_s(self) -> float:
        """How long all images have been this one, to the last pixel."""
        return (self.taken_at - self.same_since).total_seconds()

    @property
    def matches(self) -> list[dict[str, Any]]:
        """This image's match, if there is one, and those of earlier images, the newest first.

        An image that comes again is of when it was first received: cameras freeze.
        """
        if self.offset is None:
            return self.earlier
        own = {
            "taken_s": self.same_since.timestamp(),
            "offset": self.offset,
            "covariance": self.covariance,
            "inliers": self.inliers,
        }
        return [own, *self.earlier]

    @property
    def as_estimate(self) -> dict[str, Any]:
        """The turn by this image alone, as `estimates.picture`; angles in radians."""
        names = [f"{name}_rad" for name in ANGLES]
        found: dict[str, Any] = {
            "taken_at": self.same_since.isoformat(),
            "matched": self.offset is not None,
            "compared": self.compared,
            **dict.fromkeys((*names, "zoom", "sd", "shifted", "inliers")),
        }
        if self.offset is not None and self.covariance is not None:
            sd = np.sqrt(np.diag(np.array(self.covariance))).tolist()
            found |= dict(zip(names, self.offset, strict=True))
            found |= {"zoom": self.zoom, "shifted": self.shifted, "inliers": self.inliers}
            found["sd"] = dict(zip(names, sd, strict=True)) | {"zoom": self.zoom_sd}
        return found


def compared(session: Session, camera_id: str, prior_pose_id: int) -> PictureRecord | None:
    """The result of the newest image against a prior pose; None until one was compared."""
    record = session.get(PictureRecord, camera_id)
    if record is None or record.prior_pose_id != prior_pose_id or not record.compared:
        return None
    return record


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


def forget(session: Session, camera_id: str) -> bool:
    """Delete what is kept of a camera's images beside the newest one; False if nothing was."""
    return any(
        [
            session.execute(delete(record).where(record.camera_id == camera_id)).rowcount  # type: ignore[attr-defined]
            for record in (PictureReferenceRecord, PictureRecord)
        ]
    )


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
