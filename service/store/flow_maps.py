"""Flow maps, anchors, the first of them, and last poses by them."""

from datetime import datetime

from sqlalchemy import LargeBinary
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record, foreign_key


class FlowMapRecord(Record):
    """The density of paths at a reference's site (`models.paths`), learned of `tracks` tracks.

    `data` is None where too few of them walk. `chart` is the drift chart (`models.monitoring`)
    that goes with it. `to_s` is when the last of them ended, `weight` what they count for together,
    of whom older ones count less.
    """

    __tablename__ = "flow_maps"

    reference_id: Mapped[int] = foreign_key("site_references.id", primary_key=True)
    data: Mapped[bytes | None] = mapped_column(LargeBinary)
    chart: Mapped[bytes | None] = mapped_column(LargeBinary)
    tracks: Mapped[int]
    weight: Mapped[float]
    to_s: Mapped[float]
    learned_at: Mapped[datetime]


class AnchorRecord(Record):
    """The first flow map and drift chart of a reference: they never grow (`models.pose`).

    `flow` and `chart` are of tracks of which the last ended at `to_s`. `creep` is the log of whole
    days since (`models.monitoring.creep`), up to `logged_to_s`; None as long as there is none.
    """

    __tablename__ = "anchors"

    reference_id: Mapped[int] = foreign_key("site_references.id", primary_key=True)
    flow: Mapped[bytes] = mapped_column(LargeBinary)
    chart: Mapped[bytes] = mapped_column(LargeBinary)
    to_s: Mapped[float]
    learned_at: Mapped[datetime]
    creep: Mapped[bytes | None] = mapped_column(LargeBinary)
    logged_to_s: Mapped[float | None]


class LastPoseRecord(Record):
    """The beginning of the next estimate against a reference (`models.pose.pose_fit`).

    `basis` tells what it hangs on beside the tracks: of another one it says nothing.
    """

    __tablename__ = "last_poses"

    reference_id: Mapped[int] = foreign_key("site_references.id", primary_key=True)
    basis: Mapped[bytes] = mapped_column(LargeBinary)
    data: Mapped[bytes] = mapped_column(LargeBinary)


def find(session: Session, reference_id: int) -> FlowMapRecord | None:
    """The flow map of a reference; None where none was learned yet."""
    return session.get(FlowMapRecord, reference_id)


def anchor(session: Session, reference_id: int) -> AnchorRecord | None:
    """The anchor of a reference; None where none could be learned yet."""
    return session.get(AnchorRecord, reference_id)


def last_pose(session: Session, reference_id: int) -> LastPoseRecord | None:
    """The beginning of the next estimate against a reference; None where it is to look anew."""
    return session.get(LastPoseRecord, reference_id)
