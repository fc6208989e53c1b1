"""References, maps and anchors: what is usual at a site; and when somebody was at its camera."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import (
    BindParameter,
    Connection,
    ForeignKey,
    Index,
    LargeBinary,
    Select,
    String,
    bindparam,
    delete,
    exists,
    func,
    select,
    update,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, Session, aliased, defer, mapped_column

from service.enums import Answer, Origin
from service.reasons import Reasons
from service.store.estimates import EstimateRecord
from service.store.record import (
    Record,
    camera_key,
    delete_some,
    foreign_key,
    newest_first,
    one_of,
    surplus,
    vocabulary,
)


class SiteReferenceRecord(Record):
    """The estimators' answers while a camera is known to be at its prior pose; the newest counts.

    It is learned once, of the tracks of `wanted` people that started at `from_s` or later; until
    then `ready_at` is unset. It is of the tracks of one `source`, which counts: the first to post,
    where none is said. `to_s` is when the last of them ended, `data` the site (`models.walking`).
    As of the last look, `pieces` of its tracks go on others' walks, and they ended in so many
    different `hours` of date and time (UTC).
    Later, `window_from_s` is when the first track after the newest change of the camera ended. That
    change was before `changed_s` and, if its time is known, after `changed_after_s`. `answer` is a
    person's last one about the position: estimates from before `answered_at` no longer count.
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
    pieces: Mapped[int] = mapped_column(default=0)
    hours: Mapped[int] = mapped_column(default=0)
    data: Mapped[bytes | None] = mapped_column(LargeBinary)
    walking_speed_mps: Mapped[float | None]
    doubts: Mapped[Reasons]
    window_from_s: Mapped[float | None]
    changed_after_s: Mapped[float | None]
    changed_s: Mapped[float | None]
    answer: Mapped[Answer | None] = mapped_column(vocabulary(Answer, checked=False))
    answered_by: Mapped[str | None]
    answered_at: Mapped[datetime | None]
    created_at: Mapped[datetime]
    ready_at: Mapped[datetime | None]

    __table_args__ = (
        one_of("answer", (Answer.PUT_BACK, Answer.FIXED, Answer.FALSE_ALARM)),
        Index(None, "camera_id", "id"),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )


# Made once: each alias has columns of its own, which take a millisecond to make.
_Reference = aliased(SiteReferenceRecord)
# A camera by its id, by that of an enclosing query, or by a value that is given later.
CameraId = str | InstrumentedAttribute[str] | BindParameter[str]
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


def counting_source(camera_id: CameraId) -> Select[str | None]:
    """The source of a camera's newest reference."""
    newest = (
        select(_Reference.source)
        .where(_Reference.camera_id == camera_id)
        .order_by(_Reference.id.desc())
        .limit(1)
    )
    return (
        newest.correlate(camera_id.class_)
        if isinstance(camera_id, InstrumentedAttribute)
        else newest
    )


def newest(session: Session, camera_id: str) -> SiteReferenceRecord:
    """The reference of a camera that counts."""
    return session.scalars(newest_first(SiteReferenceRecord, camera_id).limit(1)).one()


def newest_if_any(session: Session, camera_id: str) -> SiteReferenceRecord | None:
    """The reference that counts; None where the camera is gone."""
    return session.scalars(newest_first(SiteReferenceRecord, camera_id).limit(1)).first()


def of_camera(session: Session, camera_id: str, limit: int) -> Sequence[SiteReferenceRecord]:
    """The references of a camera, newest first, without what was learned."""
    query = newest_first(SiteReferenceRecord, camera_id).limit(limit)
    return session.scalars(query.options(defer(SiteReferenceRecord.data))).all()


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many that no estimate names; how many."""
    beyond = surplus(SiteReferenceRecord, camera_id, keep)
    named = exists().where(EstimateRecord.reference_id == SiteReferenceRecord.id)
    of_camera = EstimateRecord.camera_id == camera_id  # by its index
    bite = (
        select(SiteReferenceRecord.id)
        .where(SiteReferenceRecord.id.in_(beyond), ~named.where(of_camera))
        .limit(limit)
    )
    return delete_some(session, SiteReferenceRecord.id, bite)


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


def map_learned_at(session: Session, reference_id: int) -> datetime | None:
    """The time at which a reference's map was learned or grew last; None where it has none."""
    record = session.get(FlowMapRecord, reference_id)
    return None if record is None else record.learned_at


def forget_later(session: Session, camera_id: str, reference_id: int) -> None:
    """Delete the references of a camera that began after one, with what was learned and told."""
    session.execute(
        delete(SiteReferenceRecord).where(
            SiteReferenceRecord.camera_id == camera_id, SiteReferenceRecord.id > reference_id
        )
    )


class AnchorRecord(Record):
    """The first flow map and drift chart of a reference: they never grow (`models.pose`).

    `flow` and `chart` are of tracks of which the last ended at `to_s`. `creep` is the log of whole
    days since (`models.monitoring.slow_drift`), up to `logged_to_s`; None as long as there is none.
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


class MaintenanceRecord(Record):
    """A time in which somebody is at a camera: what is seen in it is not judged.

    `to_at` is the plan, `ended_at` when it really ended; None until it has.
    """

    __tablename__ = "maintenance_windows"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("cameras.id", ondelete="CASCADE"))
    from_at: Mapped[datetime]
    to_at: Mapped[datetime]
    ended_at: Mapped[datetime | None]
    reason: Mapped[str | None]
    requested_by: Mapped[str | None]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]

    __table_args__ = (Index(None, "camera_id", "to_at"),)

    @property
    def until(self) -> datetime:
        """The time at which it ended, or will."""
        return self.ended_at or self.to_at

    def holds(self, now: datetime) -> bool:
        """True if somebody is there."""
        return self.from_at <= now < self.until


_UNTIL = func.coalesce(MaintenanceRecord.ended_at, MaintenanceRecord.to_at)

# Built once: each run and each reconcile of a camera asks for them.
_OF_CAMERA = (
    select(MaintenanceRecord)
    .where(MaintenanceRecord.camera_id == bindparam("camera"))
    .order_by(MaintenanceRecord.from_at, MaintenanceRecord.id)
)
_JUST_OVER = select(MaintenanceRecord).where(
    MaintenanceRecord.camera_id == bindparam("camera"),
    MaintenanceRecord.to_at <= bindparam("now"),
    MaintenanceRecord.ended_at.is_(None),
)


def find_maintenance(session: Session, camera_id: str, window_id: str) -> MaintenanceRecord | None:
    """The window of a camera, or None."""
    record = session.get(MaintenanceRecord, window_id)
    return record if record is not None and record.camera_id == camera_id else None


def maintenance_of(session: Session, camera_id: str) -> Sequence[MaintenanceRecord]:
    """A camera's windows in the order of their beginnings."""
    return session.scalars(_OF_CAMERA, {"camera": camera_id}).all()


def maintenance_under_way(
    session: Session, camera_id: str, now: datetime
) -> MaintenanceRecord | None:
    """The window that a camera is in, of several the one that ends last; None out of any."""
    return session.scalars(
        select(MaintenanceRecord)
        .where(
            MaintenanceRecord.camera_id == camera_id,
            now < _UNTIL,
            MaintenanceRecord.from_at <= now,
        )
        .order_by(_UNTIL.desc())
        .limit(1)
    ).first()


def maintenance_just_over(
    session: Session, camera_id: str, now: datetime
) -> Sequence[MaintenanceRecord]:
    """Windows that have come to their planned end, which nobody has noted yet."""
    return session.scalars(_JUST_OVER, {"camera": camera_id, "now": now}).all()


def forget_maintenance(session: Session, camera_id: str, before: datetime, limit: int) -> int:
    """Delete up to `limit` of the windows that ended before a time. Returns how many."""
    bite = (
        select(MaintenanceRecord.id)
        .where(MaintenanceRecord.camera_id == camera_id, before > _UNTIL)
        .limit(limit)
    )
    return delete_some(session, MaintenanceRecord.id, bite)
