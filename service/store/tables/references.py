"""Records of references, the flow maps learned with them, their anchors and last poses."""

from datetime import datetime

from sqlalchemy import Index, LargeBinary
from sqlalchemy.orm import Mapped, mapped_column

from service.enums import (
    Answer,
    Origin,
)
from service.reasons import Reasons
from service.store.tables.base import camera_key, foreign_key
from service.store.tables.record import Record, one_of


class SiteReferenceRecord(Record):
    """What estimators say while a camera is known to be at its prior pose; the newest counts.

    It is learned once, of `wanted` tracks that started at `from_s` or later; until then `ready_at`
    is unset. It is of the tracks of one `source`, which counts: the first to post, where none is
    said. `to_s` is when the last of them ended, `data` the site (`models.walking`).
    Later, `window_from_s` is when the first track after the newest change of the camera ended, and
    `changed_s` when it started. `answer` is what a person said last of how the camera stands:
    estimates of before `answered_at` say nothing of it any more.
    """

    __tablename__ = "site_references"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    origin: Mapped[Origin]
    source: Mapped[str | None]
    requested_by: Mapped[str | None]
    from_s: Mapped[float | None]
    to_s: Mapped[float | None]
    wanted: Mapped[int]
    tracks: Mapped[int]
    data: Mapped[bytes | None] = mapped_column(LargeBinary)
    walking_speed_mps: Mapped[float | None]
    doubts: Mapped[Reasons]
    window_from_s: Mapped[float | None]
    changed_s: Mapped[float | None]
    answer: Mapped[Answer | None]
    answered_by: Mapped[str | None]
    answered_at: Mapped[datetime | None]
    created_at: Mapped[datetime]
    ready_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("origin", Origin),
        one_of("answer", (Answer.PUT_BACK, Answer.FALSE_ALARM)),
        Index(None, "camera_id", "id"),
    )


class FlowMapRecord(Record):
    """Where people walk at a reference's site (`models.paths`), learned of `tracks` tracks.

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
    days since (`models.monitoring.creep_log`), up to `logged_to_s`; None as long as there is none.
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
    """Where the next estimate against a reference may begin (`models.pose.warm_start`).

    `basis` tells what it hangs on beside the tracks: of another one it says nothing.
    """

    __tablename__ = "last_poses"

    reference_id: Mapped[int] = foreign_key("site_references.id", primary_key=True)
    basis: Mapped[bytes] = mapped_column(LargeBinary)
    data: Mapped[bytes] = mapped_column(LargeBinary)
