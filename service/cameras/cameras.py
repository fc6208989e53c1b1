"""Register, change and remove cameras."""

import itertools
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy.orm import Session

from models.geometry.ground_homography import pose_from_homography
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.geometry.usual_pose import usual_pose
from service.access.activity import note
from service.alerts.alerts import close_pose_alerts, end_alert, list_alerts
from service.cameras.held_poses import held_pose, keep_drawn
from service.cameras.image_sizes import declare_size, declared_size, forget_frame_size
from service.cameras.image_source import set_image_source
from service.cameras.reference_views import ReferenceView, reference_views
from service.cameras.status import CameraStatus, camera_statuses
from service.enums import Activity, AlertState, Origin, Outcome, PoseState
from service.errors import (
    ConflictError,
    NotFoundError,
    TooManyCamerasError,
    check_version,
)
from service.estimate_queue import request_estimate
from service.formats.scaling import ImageSize
from service.job_queue import JobQueue
from service.notifications.events import tell_of_camera
from service.notifications.fetch import Credentials
from service.references import begin_reference
from service.settings import Settings
from service.store import cameras, references, tracks
from service.store.access import name_in
from service.store.alerts import AlertFilter
from service.store.cameras import CameraRecord, PriorPoseRecord
from service.training import stop_trainings, train_by_itself

_MANY = 1000  # more alerts than a camera has kinds
_DESCRIBING = {"name", "site", "tags"}  # fields that nothing hangs on


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSpec:
    """A camera as an integrator registers it; `given` is all that is known without a prior pose."""

    camera_id: str | None
    name: str
    intrinsics: Intrinsics
    prior_pose: CameraPose | None
    given: Mapping[str, float] = field(default_factory=dict)
    frame_rate_hz: float | None
    walking_speed_mean_mps: float
    walking_speed_sd_mps: float
    reference_tracks: int
    snapshot_url: str | None = None
    snapshot_credentials: Credentials | None = None
    site: str = ""
    tags: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChange:
    """Changes to a camera; None stays.

    Instead of a prior pose: `given` as in `CameraSpec`, or a `homography` (3, 3) from the ground to
    the undistorted image, which the lens makes a pose.
    """

    name: str | None = None
    site: str | None = None
    tags: Sequence[str] | None = None
    intrinsics: Intrinsics | None = None
    prior_pose: CameraPose | None = None
    given: Mapping[str, float] | None = None
    homography: Array | None = None
    frame_rate_hz: float | None = None
    walking_speed_mean_mps: float | None = None
    walking_speed_sd_mps: float | None = None
    reference_tracks: int | None = None
    snapshot_url: str | None = None
    snapshot_credentials: Credentials | Literal[""] | None = None
    image_size: ImageSize | None = None


_SEPARATE = (  # changes that are no columns, or have more to them
    *("intrinsics", "prior_pose", "given", "homography"),
    *("snapshot_url", "snapshot_credentials", "image_size"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraView:
    """A camera as clients see it; `calibrated` once its prior pose was given or confirmed.

    `measured` is what is known of a pose before that, in metres and radians. `image_size` is
    declared for the active source of its tracks.
    """

    record: CameraRecord
    prior_pose: CameraPose
    calibrated: bool
    measured: Mapping[str, float]
    tracks: int
    model_id: str | None
    state: PoseState
    reference: ReferenceView
    image_size: ImageSize | None

    @property
    def intrinsics(self) -> Intrinsics:
        """The lens."""
        return self.record.intrinsics

    @property
    def etag(self) -> str:
        """The version of the camera's own fields."""
        return etag_of(self.record)


def register_camera(
    session: Session, queue: JobQueue, settings: Settings, spec: CameraSpec
) -> CameraView:
    """Store a camera with its prior pose and queue its first training.

    Raises:
        ConflictError: the id is taken.
        TooManyCamerasError: as many are registered as may be.
    """
    camera_id = spec.camera_id or f"camera-{secrets.token_hex(4)}"
    if session.get(CameraRecord, camera_id) is not None:
        raise ConflictError(f"id: {camera_id!r} is taken")
    if cameras.count(session) >= settings.max_cameras:
        raise TooManyCamerasError(
            f"cameras: {settings.max_cameras} are registered already; delete one that is not used, "
            "or raise SUREFOOT_MAX_CAMERAS"
        )
    now = datetime.now(UTC)
    record = CameraRecord(
        id=camera_id,
        name=spec.name or camera_id,
        site=spec.site or None,
        tags=list(spec.tags),
        **_columns(spec.intrinsics),
        frame_rate_hz=spec.frame_rate_hz,
        walking_speed_mean_mps=spec.walking_speed_mean_mps,
        walking_speed_sd_mps=spec.walking_speed_sd_mps,
        reference_tracks=spec.reference_tracks,
        version=1,
        estimate_due_at=None,
        read_track_pk=None,
        checked_at=None,
        full_estimate_asked=False,
        created_at=now,
        updated_at=now,
    )
    set_image_source(record, settings, spec.snapshot_url, spec.snapshot_credentials)
    session.add(record)
    session.flush()
    if spec.prior_pose is None:
        pose = usual_pose(spec.given)
        given = list(spec.given)
        add_prior_pose(session, camera_id, pose, Origin.ASSUMED, None, given=given)
        begin_reference(session, camera_id, Origin.ASSUMED, from_s=None)
    else:
        add_prior_pose(session, camera_id, spec.prior_pose, Origin.REGISTERED, None)
        begin_reference(session, camera_id, Origin.REGISTERED, from_s=None)
        train_by_itself(session, queue, settings, camera_id)
    note(session, Activity.CAMERA_REGISTERED, by=None, camera_id=camera_id)
    tell_of_camera(session, camera_id)
    return view_camera(session, settings, camera_id)


def view_camera(session: Session, settings: Settings, camera_id: str) -> CameraView:
    """A camera.

    Raises:
        NotFoundError: there is none of that id.
    """
    views = _views(session, settings, camera_statuses(session, settings, (camera_id,)))
    if not views:
        raise no_camera(camera_id)
    return views[0]


def list_cameras(
    session: Session,
    settings: Settings,
    after_id: str,
    limit: int,
    states: Collection[PoseState] = (),
    site: str = "",
    tags: Collection[str] = (),
) -> list[CameraView]:
    """Some cameras in order of their ids, after one; of some states alone, if any are named.

    So with a site, which is all that lies below it, and with tags, which are all needed. By a
    handful of statements, however many they are.
    """
    # A state is derived and stands in no column.
    if site or tags:
        ids = cameras.ids_labelled(session, after_id, site, tags)[: None if states else limit]
    else:
        ids = cameras.ids(session, after_id, None if states else limit)
    statuses = camera_statuses(session, settings, ids)
    if states:
        wanted = (i for i, each in statuses.items() if each.state in states)
        statuses = {i: statuses[i] for i in itertools.islice(wanted, limit)}
    return _views(session, settings, statuses)


def etag_of(record: CameraRecord) -> str:
    """Changes whenever the camera's own fields do."""
    made_us = round(record.created_at.timestamp() * 1e6)  # another may have had the id before
    return f'"{record.id}-{made_us:x}-{record.version}"'


def change_camera(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    etag: str | None,
    change: CameraChange,
    by: str | None = None,
) -> CameraView:
    """Change a camera; another lens or prior pose queues a training.

    Another image size of its tracks rescales those that are stored; its reference is learned anew.

    Raises:
        NotFoundError: there is none of that id.
        ConflictError: an image size, and the camera has no tracks yet.
        PreconditionFailedError: it was changed since the client read it.
        PreconditionRequiredError: the client does not say what it has read.
        ConflictError: measurements are given of a camera that has a prior pose.
        DegenerateGeometryError: the homography contradicts the lens.
    """
    record = require_camera(session, camera_id)
    check_version("the camera is", etag_of(record), etag)
    prior = cameras.prior_pose(session, camera_id)
    if change.given is not None and not prior.assumed:
        raise ConflictError(
            "prior_pose: the camera has one; height_m and tilt_deg are both required to replace it "
            f"(got {len(change.given)} of height_m, tilt_deg, roll_deg)"
        )
    if change.homography is not None:
        lens = change.intrinsics or record.intrinsics
        pose = pose_from_homography(change.homography, lens)
        change = replace(change, prior_pose=pose, homography=None)
    changed = {
        field.name: getattr(change, field.name)
        for field in fields(change)
        if getattr(change, field.name) is not None
    }
    columns = {} if change.intrinsics is None else _columns(change.intrinsics)
    size = record.width, record.height
    for name, value in {**changed, **columns}.items():
        if name not in _SEPARATE:
            setattr(record, name, value)
    record.name, record.site = record.name or record.id, record.site or None
    set_image_source(record, settings, change.snapshot_url, change.snapshot_credentials)
    record.version += 1
    record.updated_at = datetime.now(UTC)
    reference = references.newest(session, camera_id)
    if change.reference_tracks is not None and reference.ready_at is None:
        reference.wanted = change.reference_tracks
        request_estimate(session, queue, camera_id)
    geometry_changed = change.intrinsics is not None or change.prior_pose is not None
    speed_changed = "walking_speed_mean_mps" in changed or "walking_speed_sd_mps" in changed
    if (record.width, record.height) != size:
        forget_frame_size(record, size)
    rescaled = False
    if change.image_size is not None:
        rescaled = declare_size(session, record, change.image_size, by)
        request_estimate(session, queue, camera_id)
    if geometry_changed or speed_changed or rescaled or change.given is not None:
        # A model is for one lens at one prior pose: the new record makes the old one too old.
        if change.prior_pose is not None:
            close_pose_alerts(session, camera_id, Outcome.ACCEPTED, name_in(session, by))
        # Tracks seen so far may be of another pose or lens, but not of other people; those that
        # were rescaled are of the same pose.
        from_s = reference.from_s
        if geometry_changed:
            from_s = tracks.newest_end_s(session, camera_id)
        pose, origin = change.prior_pose or prior.pose, Origin.CHANGED
        given: Sequence[str] = ()
        hints: Sequence[dict[str, Any]] = ()
        covariance: list[list[float]] | None = None
        if change.prior_pose is None:  # how sure it is, and what was marked, stays
            covariance = prior.covariance
            if prior.assumed:
                origin, given = Origin.ASSUMED, prior.given
                if change.given is not None:
                    pose, given = usual_pose(change.given), list(change.given)
                hints = prior.hints if (record.width, record.height) == size else ()
        held = held_pose(session, camera_id)
        renew_prior_pose(
            session,
            queue,
            settings,
            camera_id,
            pose,
            origin,
            from_s=from_s,
            by=by,
            given=given,
            hints=hints,
            covariance=covariance,
        )
        if held.assumed and origin != Origin.ASSUMED:
            keep_drawn(session, camera_id, held)
    words = {name: value for name, value in changed.items() if name in _DESCRIBING}
    # An answer about the pose can be taken back after other words for the camera.
    what = Activity.CAMERA_CHANGED if len(words) < len(changed) else Activity.CAMERA_DESCRIBED
    names = ["prior_pose" if name == "given" else name for name in changed]
    details = {"fields": names, **words}
    note(session, what, by=by, camera_id=camera_id, details=details)
    tell_of_camera(session, camera_id)
    session.flush()
    return view_camera(session, settings, camera_id)


def remove_camera(
    session: Session, camera_id: str, etag: str | None, by: str | None = None
) -> None:
    """Delete a camera with all that is stored of it; who was told of its alerts is told their end.

    Raises:
        NotFoundError: there is none of that id.
        PreconditionFailedError: it was changed since the client read it.
        PreconditionRequiredError: the client does not say what it has read.
    """
    record = require_camera(session, camera_id)
    check_version("the camera is", etag_of(record), etag)
    for alert in list_alerts(
        session, AlertFilter(state=AlertState.FIRING, camera_id=camera_id), _MANY
    ):
        end_alert(session, camera_id, alert.kind, Outcome.CAMERA_REMOVED)
    details = {"name": record.name}
    note(session, Activity.CAMERA_REMOVED, by=by, camera_id=camera_id, details=details)
    tell_of_camera(session, camera_id, removed=True)
    session.delete(record)


def require_camera(session: Session, camera_id: str) -> CameraRecord:
    """The record of a camera.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = session.get(CameraRecord, camera_id)
    if record is None:
        raise no_camera(camera_id)
    return record


def no_camera(camera_id: str) -> NotFoundError:
    """The error where there is no camera of an id."""
    return NotFoundError(f"camera_id: there is no camera {camera_id!r}")


def renew_prior_pose(
    session: Session,
    queue: JobQueue,
    settings: Settings,
    camera_id: str,
    pose: CameraPose,
    origin: Origin,
    *,
    from_s: float | None,
    by: str | None,
    given: Sequence[str] = (),
    hints: Sequence[dict[str, Any]] = (),
    covariance: list[list[float]] | None = None,
) -> None:
    """Make a pose the prior pose, with a reference of the tracks that start at or after a time.

    It is trained at, instead of whatever training is under way; but one that is assumed is not.
    """
    add_prior_pose(
        session, camera_id, pose, origin, by, given=given, hints=hints, covariance=covariance
    )
    begin_reference(session, camera_id, origin, from_s=from_s, by=by)
    request_estimate(session, queue, camera_id)
    stop_trainings(session, camera_id)
    if origin != Origin.ASSUMED:
        train_by_itself(session, queue, settings, camera_id)


def add_prior_pose(
    session: Session,
    camera_id: str,
    pose: CameraPose,
    origin: Origin,
    by: str | None,
    *,
    given: Sequence[str] = (),
    hints: Sequence[dict[str, Any]] = (),
    covariance: list[list[float]] | None = None,
) -> None:
    """Make a pose the prior pose; the earlier ones stay as history."""
    session.add(
        PriorPoseRecord(
            camera_id=camera_id,
            **asdict(pose),
            origin=origin,
            trusted_by=name_in(session, by),
            given=list(given),
            hints=list(hints),
            covariance=covariance,
            created_at=datetime.now(UTC),
        )
    )
    session.flush()


def _views(
    session: Session, settings: Settings, statuses: Mapping[str, CameraStatus]
) -> list[CameraView]:
    views = reference_views(session, settings, statuses)
    counts = tracks.counts(session, statuses.keys())
    return [
        CameraView(
            record=record,
            prior_pose=prior.pose,
            calibrated=not prior.assumed,
            measured=prior.measured if prior.assumed else {},
            tracks=counts.get(record.id, 0),
            model_id=model_id,
            state=statuses[record.id].state,
            reference=views[record.id],
            image_size=declared_size(record, statuses[record.id].reference.source),
        )
        for record, prior, model_id in cameras.all_as_set_up(session, statuses.keys())
    ]


def _columns(lens: Intrinsics) -> dict[str, Any]:
    """A lens as the columns of a camera."""
    return {**asdict(lens), "distortion": list(lens.distortion)}
