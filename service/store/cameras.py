"""Cameras, their prior poses, arrival models, still images and plans."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from typing import Any, TypeVar

from sqlalchemy import (
    JSON,
    ColumnElement,
    Connection,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    Row,
    String,
    bindparam,
    case,
    cast,
    delete,
    func,
    or_,
    select,
    type_coerce,
    update,
)
from sqlalchemy.orm import InstrumentedAttribute, Mapped, Session, defer, mapped_column

from models.geometry.intrinsics import Intrinsics, Projection
from models.geometry.pose import CameraPose
from service.enums import Origin
from service.reasons import Reasons, ServiceCode
from service.store.engines.sqlite import Prepared
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
from service.store.references import SiteReferenceRecord, counting_source
from service.store.trainings import ModelRecord, TrainingRecord
from service.store.zones import ZonesRecord


class CameraRecord(Record):
    """A registered camera. `estimate_due_at` is set while tracks wait for an estimation run.

    `read_track_pk` is the newest track that a run has read, `checked_at` the time of that run;
    `full_estimate_asked` is true if the next run has to be a full one. `estimate_tries` counts the
    runs since the last one that finished. If they fail, `estimate_error` is the reason and
    `estimate_failing_since` the time of the first failure. No run starts before `estimate_after`.
    `missing_parts` has the failures beside the served estimate.

    The next image is requested from `snapshot_url` at `snapshot_due_at`, at once if that is None;
    `snapshot_error` is the reason why the last request failed. `snapshot_credentials` are sealed
    with the key of the data directory. `snapshot_digest` is set once the host of `snapshot_url`
    has asked for Digest. `site` is a path, or None. `image_sizes` has the declared size (width,
    height) of the images that a source's numbers refer to, None for shares.
    """

    __tablename__ = "cameras"

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    name: Mapped[str]
    site: Mapped[str | None]
    tags: Mapped[list[str]] = mapped_column(default=list)
    width: Mapped[int]
    height: Mapped[int]
    fx: Mapped[float]
    fy: Mapped[float]
    cx: Mapped[float]
    cy: Mapped[float]
    distortion: Mapped[list[float]]
    projection: Mapped[Projection] = mapped_column(default=Projection.PERSPECTIVE)
    frame_rate_hz: Mapped[float | None]
    walking_speed_mean_mps: Mapped[float]
    walking_speed_sd_mps: Mapped[float]
    reference_tracks: Mapped[int]
    version: Mapped[int]
    estimate_due_at: Mapped[datetime | None]
    read_track_pk: Mapped[int | None]
    checked_at: Mapped[datetime | None]
    full_estimate_asked: Mapped[bool] = mapped_column(default=False)
    estimate_tries: Mapped[int] = mapped_column(default=0)
    estimate_error: Mapped[str | None]
    estimate_failing_since: Mapped[datetime | None]
    estimate_after: Mapped[datetime | None]
    missing_parts: Mapped[Reasons] = mapped_column(default=())
    snapshot_url: Mapped[str | None]
    snapshot_due_at: Mapped[datetime | None]
    snapshot_error: Mapped[str | None]
    created_at: Mapped[datetime]
    updated_at: Mapped[datetime]
    snapshot_credentials: Mapped[str | None]
    snapshot_digest: Mapped[bool] = mapped_column(default=False)
    image_sizes: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))

    @property
    def intrinsics(self) -> Intrinsics:
        """The lens."""
        return Intrinsics(**{each.name: getattr(self, each.name) for each in fields(Intrinsics)})


_ORIGINS = (
    Origin.REGISTERED, Origin.CHANGED, Origin.ACCEPTED, Origin.ASSUMED, Origin.CONFIRMED
)  # fmt: skip


class PriorPoseRecord(Record):
    """A pose that was trusted from a time on; the newest of a camera is its prior pose.

    One that is assumed was trusted by nobody; `given` names what was measured of it, in the words
    of `CameraPose`. `covariance` is of tilt, roll, log height and, where it was accepted, heading:
    of a pose that people told.
    """

    __tablename__ = "prior_poses"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    heading_rad: Mapped[float]
    x_m: Mapped[float]
    y_m: Mapped[float]
    origin: Mapped[Origin] = mapped_column(vocabulary(Origin, checked=False))
    trusted_by: Mapped[str | None]
    hints: Mapped[list[dict[str, Any]]] = mapped_column(JSON, default=list)
    given: Mapped[list[str]] = mapped_column(JSON, default=list)
    covariance: Mapped[list[list[float]] | None] = mapped_column(JSON(none_as_null=True))
    created_at: Mapped[datetime]

    __table_args__ = (
        one_of("origin", _ORIGINS),
        Index(None, "camera_id", "id"),
        {"sqlite_autoincrement": True},  # an id is never given twice
    )

    @property
    def pose(self) -> CameraPose:
        """As a value."""
        return CameraPose(**{each.name: getattr(self, each.name) for each in fields(CameraPose)})

    @property
    def assumed(self) -> bool:
        """True if the pose was neither given nor confirmed."""
        return self.origin == Origin.ASSUMED

    @property
    def measured(self) -> dict[str, float]:
        """What was measured of a pose that is assumed."""
        return {name: getattr(self, name) for name in self.given}


class ProposedPoseRecord(Record):
    """The newest estimated pose of a camera whose prior pose is assumed.

    `covariance` (3, 3) is of tilt, roll and log height; `identifiable` names the
    parameters that are certain enough to be confirmed.
    """

    __tablename__ = "proposed_poses"

    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", primary_key=True)
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    covariance: Mapped[list[list[float]]] = mapped_column(JSON)
    identifiable: Mapped[list[str]] = mapped_column(JSON)
    tracks: Mapped[int]
    walking_groups: Mapped[int]
    created_at: Mapped[datetime]

    @property
    def pose(self) -> CameraPose:
        """As a value, over the world's origin and with no heading: people tell neither."""
        return CameraPose(height_m=self.height_m, tilt_rad=self.tilt_rad, roll_rad=self.roll_rad)


def newest_of(
    column: InstrumentedAttribute[Any], camera_id: InstrumentedAttribute[str]
) -> ColumnElement[Any]:
    """The largest value of a column among what is stored of each camera: a lookup in an index."""
    return (
        select(func.max(column))
        .where(camera_id == CameraRecord.id)
        .correlate(CameraRecord)
        .scalar_subquery()
    )


# Built once: each request for a pose asks for them.
_NEWEST_POSE = newest_of(PriorPoseRecord.id, PriorPoseRecord.camera_id)
_NEWEST_MODEL = (
    select(ModelRecord.id)
    .where(ModelRecord.camera_id == CameraRecord.id)
    .order_by(ModelRecord.created_at.desc())
    .limit(1)
    .correlate(CameraRecord)
    .scalar_subquery()
)
_SET_UP = select(CameraRecord, PriorPoseRecord, _NEWEST_MODEL).join(
    PriorPoseRecord, PriorPoseRecord.id == _NEWEST_POSE
)
_ONE_SET_UP = _SET_UP.where(CameraRecord.id == bindparam("camera"))
_SOME_SET_UP = _SET_UP.where(CameraRecord.id.in_(bindparam("cameras", expanding=True))).order_by(
    CameraRecord.id
)
_PRIOR_POSE = newest_first(PriorPoseRecord, bindparam("camera")).limit(1)

_RUN_ENDED = (
    update(CameraRecord.__table__)  # type: ignore[arg-type]
    .where(CameraRecord.id == bindparam("camera"))
    .values(
        read_track_pk=bindparam("newest"),
        checked_at=case(
            (CameraRecord.read_track_pk.is_distinct_from(bindparam("newest")), bindparam("now")),
            else_=CameraRecord.checked_at,
        ),
        estimate_tries=0,
        estimate_error=None,
        estimate_failing_since=None,
        estimate_after=bindparam("until"),
        missing_parts=bindparam("failures"),
    )
)


def finish_run(
    session: Session,
    camera_id: str,
    newest_pk: int | None,
    now: datetime,
    until: datetime,
    failures: Reasons,
) -> None:
    """Note that an estimation run read tracks up to one; the camera cools down until a time.

    A record of the camera that the session has loaded keeps its old values.
    """
    values = {"camera": camera_id, "newest": newest_pk, "now": now}
    session.execute(_RUN_ENDED, {**values, "until": until, "failures": failures})


# A record takes ten times as long as what each post of tracks has to know of its camera.
_AWAITED = Prepared(
    select(
        type_coerce(CameraRecord.estimate_due_at.is_(None), Integer),
        type_coerce(counting_source(CameraRecord.id).scalar_subquery().is_(None), Integer),
        CameraRecord.width,
        CameraRecord.height,
        CameraRecord.frame_rate_hz,
        type_coerce(CameraRecord.projection, String),
        cast(CameraRecord.image_sizes, String),
    ).where(CameraRecord.id == bindparam("camera"))
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """The pictures of a camera: their size, and how many a second, where that is known.

    `fisheye` is the lens, where it has no picture of some pixels. `image_sizes` are declared for
    sources, as JSON.
    """

    width: int
    height: int
    frame_rate_hz: float | None
    fisheye: Intrinsics | None
    image_sizes: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Awaited:
    """The reasons to await a camera's tracks: a `look` at them, a `source` for its reference.

    `picture` is what they have to keep to.
    """

    look: bool
    source: bool
    picture: Picture


def awaited(connection: Connection, camera_id: str) -> Awaited | None:
    """The reasons to await tracks of a camera; None where there is no such camera."""
    row = _AWAITED.row(connection, {"camera": camera_id})
    if row is None:
        return None
    fisheye = None if row[5] == Projection.PERSPECTIVE else _lens(connection, camera_id)
    seen = Picture(
        width=row[2],
        height=row[3],
        frame_rate_hz=row[4],
        fisheye=fisheye,
        image_sizes=row[6],
    )
    return Awaited(look=bool(row[0]), source=bool(row[1]), picture=seen)


def _lens(connection: Connection, camera_id: str) -> Intrinsics:
    columns = (getattr(CameraRecord, each.name) for each in fields(Intrinsics))
    row = connection.execute(select(*columns).where(CameraRecord.id == camera_id)).one()
    return Intrinsics(**row._mapping)


def as_set_up(
    session: Session, camera_id: str
) -> tuple[CameraRecord, PriorPoseRecord, str | None] | None:
    """The camera, its prior pose and the id of its model in use, if it has one; or None."""
    row = session.execute(_ONE_SET_UP, {"camera": camera_id}).first()
    return None if row is None else (row[0], row[1], row[2])


def all_as_set_up(
    session: Session, ids: Collection[str]
) -> list[tuple[CameraRecord, PriorPoseRecord, str | None]]:
    """The same of some cameras, in order of their ids."""
    rows = session.execute(_SOME_SET_UP, {"cameras": list(ids)})
    return [(row[0], row[1], row[2]) for row in rows]


def ids(session: Session, after_id: str = "", limit: int | None = None) -> Sequence[str]:
    """The ids of cameras after one, in order; of all, unless it is said how many."""
    query = select(CameraRecord.id).where(CameraRecord.id > after_id)
    return session.scalars(query.order_by(CameraRecord.id).limit(limit)).all()


def ids_labelled(
    session: Session, after_id: str, site: str, tags: Collection[str]
) -> Sequence[str]:
    """The same of those at a site, or below it, that have all of some tags; of any site if empty.

    No index: of as many cameras as there may be, all are looked through in milliseconds.
    """
    query = select(CameraRecord.id, CameraRecord.tags).where(CameraRecord.id > after_id)
    if site:  # not by LIKE, which minds the case on one database and not on the other
        below = func.substr(CameraRecord.site, 1, len(site) + 1) == f"{site}/"
        query = query.where(or_(CameraRecord.site == site, below))
    rows = session.execute(query.order_by(CameraRecord.id))
    return [camera_id for camera_id, own in rows if set(tags) <= set(own)]


def sites(session: Session) -> Sequence[str]:
    """All sites that somebody has said, in order."""
    named = select(CameraRecord.site).where(CameraRecord.site.is_not(None)).distinct()
    return [str(site) for site in session.scalars(named.order_by(CameraRecord.site))]


def count(session: Session) -> int:
    """The number of cameras."""
    return session.scalar(select(func.count()).select_from(CameraRecord)) or 0


def prior_pose(session: Session, camera_id: str) -> PriorPoseRecord:
    """The pose that a camera is trusted to have had last."""
    return session.scalars(_PRIOR_POSE, {"camera": camera_id}).one()


def proposed_pose(session: Session, prior_pose_id: int) -> ProposedPoseRecord | None:
    """The pose that people told instead of one that is assumed; None where they did not yet."""
    return session.get(ProposedPoseRecord, prior_pose_id)


def prior_pose_at(session: Session, camera_id: str, at: datetime) -> PriorPoseRecord:
    """The pose that a camera was trusted to have at a time; its first one before all of them.

    An assumed pose is returned only if no pose was ever given or confirmed.
    """
    query = newest_first(PriorPoseRecord, camera_id)
    trusted = query.where(PriorPoseRecord.origin != Origin.ASSUMED)
    found = session.scalars(trusted.where(PriorPoseRecord.created_at <= at).limit(1)).first()
    if found is None:
        first = trusted.order_by(None).order_by(PriorPoseRecord.id)
        found = session.scalars(first.limit(1)).first()
    return found or session.scalars(query.limit(1)).one()


def prior_poses(session: Session, camera_id: str, limit: int) -> Sequence[PriorPoseRecord]:
    """The poses that a camera was trusted to have, newest first."""
    return session.scalars(newest_first(PriorPoseRecord, camera_id).limit(limit)).all()


def forget_poses(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many that nothing names; how many."""
    beyond = surplus(PriorPoseRecord, camera_id, keep)
    naming = (SiteReferenceRecord, TrainingRecord, ModelRecord, EstimateRecord, ZonesRecord)
    named = [select(one.prior_pose_id).where(one.camera_id == camera_id) for one in naming]
    bite = (
        select(PriorPoseRecord.id)
        .where(
            PriorPoseRecord.id.in_(beyond),
            *(PriorPoseRecord.id.not_in(query) for query in named),
        )
        .limit(limit)
    )
    return delete_some(session, PriorPoseRecord.id, bite)


def failing(session: Session, besides: Collection[str] = ()) -> Sequence[CameraRecord]:
    """Cameras whose last look failed, and some others, by their ids."""
    return session.scalars(
        select(CameraRecord)
        .where(CameraRecord.estimate_failing_since.is_not(None) | CameraRecord.id.in_(besides))
        .order_by(CameraRecord.estimate_failing_since, CameraRecord.id)
    ).all()


@dataclass(frozen=True, slots=True, kw_only=True)
class DueImage:
    """An image that is due. `answers`: the camera sent one when it was last asked."""

    camera_id: str
    url: str
    answers: bool


def snapshots_due(session: Session, now: datetime, every: timedelta) -> list[DueImage]:
    """Images that are due: first of cameras that answer, then the longest due.

    A time beyond twice `every` from now was set before the clock was set back.
    """
    at = CameraRecord.snapshot_due_at
    due = or_(at.is_(None), at <= now, at > now + 2 * every)
    rows = session.execute(
        select(CameraRecord.id, CameraRecord.snapshot_url, at, CameraRecord.snapshot_error)
        .where(CameraRecord.snapshot_url.is_not(None), due)
        .order_by(at, CameraRecord.id)
    )
    found = [
        DueImage(camera_id=camera_id, url=str(url), answers=at is not None and error is None)
        for camera_id, url, at, error in rows
    ]
    return sorted(found, key=lambda each: not each.answers)


def with_credentials(session: Session) -> Sequence[CameraRecord]:
    """Cameras that have credentials for their image."""
    has = CameraRecord.snapshot_credentials.is_not(None)
    return session.scalars(select(CameraRecord).where(has).order_by(CameraRecord.id)).all()


def digest_urls(session: Session) -> Sequence[str]:
    """Addresses of images at hosts that have asked for Digest."""
    asked = CameraRecord.snapshot_url.is_not(None), CameraRecord.snapshot_digest
    return [str(url) for url in session.scalars(select(CameraRecord.snapshot_url).where(*asked))]


def lacking(session: Session, code: ServiceCode) -> set[str]:
    """The ids of cameras whose estimate has a missing part with this reason code."""
    missing_parts = cast(CameraRecord.missing_parts, String)
    return set(session.scalars(select(CameraRecord.id).where(missing_parts.contains(f'"{code}"'))))


class RhythmRecord(Record):
    """The arrival model of a camera: how many people come when, and how late.

    `counts` has the tracks of each hour that they were learned of: it outlives the tracks. The
    times beside the profile are what pages of all cameras ask, and empty where it is.
    """

    __tablename__ = "camera_rhythms"

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    profile: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    usual_gap_s: Mapped[float | None]
    delay_s: Mapped[float | None]
    counts: Mapped[dict[str, Any]]
    learned_at: Mapped[datetime]


def arrival_profile(session: Session, camera_id: str) -> Row[Any] | None:
    """The profile of a camera and the times beside it; None where there is none yet."""
    query = select(RhythmRecord.profile, RhythmRecord.usual_gap_s, RhythmRecord.delay_s)
    found = RhythmRecord.camera_id == camera_id, RhythmRecord.profile.is_not(None)
    return session.execute(query.where(*found)).first()


class ImageRecord(Record):
    """An image of a camera, a JPEG, in a row of its own: no other query reads it."""

    __abstract__ = True

    camera_id: Mapped[str] = mapped_column(
        ForeignKey("cameras.id", ondelete="CASCADE"), primary_key=True
    )
    jpeg: Mapped[bytes] = mapped_column(LargeBinary)
    sha256: Mapped[str] = mapped_column(String(64))
    width: Mapped[int]
    height: Mapped[int]
    stored_at: Mapped[datetime]


class SnapshotRecord(ImageRecord):
    """A still image of what a camera sees."""

    __tablename__ = "snapshots"

    taken_at: Mapped[datetime]
    compared_at: Mapped[datetime | None]


class PlanRecord(ImageRecord):
    """A plan of the ground that a camera sees, from above: an aerial picture or a floor plan.

    `north_rad` is the direction of north on it, clockwise from up.
    """

    __tablename__ = "plans"

    metres_per_pixel: Mapped[float]
    north_rad: Mapped[float]


Image = TypeVar("Image", bound=ImageRecord)


def image_facts(session: Session, kind: type[Image], camera_id: str) -> Image | None:
    """The still image or the plan of a camera, of which the picture itself is not read."""
    return session.get(kind, camera_id, options=(defer(kind.jpeg),))


def waiting_snapshot(session: Session, camera_id: str) -> SnapshotRecord | None:
    """The still image of a camera that nobody has compared; one that was is not even read."""
    waits = SnapshotRecord.compared_at.is_(None)
    found = select(SnapshotRecord).where(SnapshotRecord.camera_id == camera_id, waits)
    return session.scalars(found).first()


def remove_image(session: Session, kind: type[ImageRecord], camera_id: str) -> bool:
    """Delete the still image or the plan of a camera; False if there was none."""
    found = delete(kind).where(kind.camera_id == camera_id)
    return bool(session.execute(found).rowcount)  # type: ignore[attr-defined]
