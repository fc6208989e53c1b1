"""The served pose, from the store alone; its history; accepting it; going back to the prior."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Literal

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from service.errors import ConflictError
from service.job_queue import JobQueue
from service.recalibration.activity import note as note_activity
from service.recalibration.alerts import close_pose_alerts
from service.recalibration.attendance import Attendance, attendance_of
from service.recalibration.cameras import renew_prior_pose, require_camera
from service.recalibration.presence import silence_of
from service.recalibration.references import (
    FEWEST_WALKERS,
    begin_reference,
    is_outdated,
    tracks_so_far,
    wanted_tracks,
    window_beside,
    window_of,
)
from service.recalibration.trainings import request_estimate
from service.settings import Settings
from service.store import cameras, estimates, maintenance, references, tracks, trainings
from service.store.alert_tables import MaintenanceRecord
from service.store.packing import pose_of_prior
from service.store.tables import EstimateRecord, SiteReferenceRecord
from service.store.tracks import WindowBounds

PoseState = Literal["learning", "ok", "drifting", "no_data", "out_of_range"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceView:
    """What is served of a camera's reference."""

    ready: bool
    tracks: int
    wanted: int
    walking_speed_mps: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseView:
    """What is served of a camera's pose. `estimate` may be one that tells nothing yet."""

    camera_id: str
    state: PoseState
    reason: str
    pose: CameraPose
    estimate: EstimateRecord | None
    reference: ReferenceView
    model_id: str | None
    etag: str

    @property
    def told(self) -> tuple[str, ...]:
        """Those of tilt, roll, height, heading that are estimated."""
        return () if self.estimate is None else tuple(self.estimate.told)


def view_pose(session: Session, settings: Settings, camera_id: str) -> PoseView:
    """The served pose, from the store alone.

    Raises:
        NotFoundError: there is no such camera.
    """
    camera = require_camera(session, camera_id)
    prior_record = cameras.prior_pose(session, camera_id)
    reference = references.newest(session, camera_id)
    model = trainings.newest_model(session, camera_id)
    estimate = estimates.newest(session, camera_id)
    estimate = counting_estimate(session, settings, reference, estimate)
    so_far = tracks_so_far(session, settings, reference)
    window = maintenance.under_way(session, camera_id, datetime.now(UTC))
    state, reason = _state(session, settings, reference, estimate, so_far)
    if window is not None:
        reason = f"{_describe_window(window)}; {reason}"
    pose = pose_of_prior(prior_record)
    if estimate is not None:
        pose = replace(
            pose,
            height_m=estimate.height_m,
            tilt_rad=estimate.tilt_rad,
            roll_rad=estimate.roll_rad,
            heading_rad=estimate.heading_rad,
        )
    version = 0 if estimate is None else estimate.id
    model_id = None if model is None else model.id
    ready = reference.ready_at is not None
    return PoseView(
        camera_id=camera_id,
        state=state,
        reason=reason,
        pose=pose,
        estimate=estimate,
        reference=ReferenceView(
            ready=ready,
            tracks=so_far,
            wanted=reference.wanted,
            walking_speed_mps=reference.walking_speed_mps,
        ),
        model_id=model_id,
        etag=f'"{prior_record.id}-{reference.id}-{version}-{state}-{so_far}-{ready:d}'
        f"-{reference.wanted}-{(model_id or 'none')[:8]}-{camera.version}"
        f'-{zlib.crc32(reason.encode()):08x}"',
    )


def pose_history(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, limit: int
) -> Sequence[EstimateRecord]:
    """The estimates between two times, oldest first; the newest so many of them.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    return estimates.between(session, camera_id, start, end, limit)


def thinned_history(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, most: int
) -> Sequence[EstimateRecord]:
    """At most so many of the estimates between two times, evenly thinned out, oldest first.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    return estimates.thinned(session, camera_id, start, end, most)


def accept_pose(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, by: str | None
) -> PoseView:
    """Make the served pose the new prior pose, close its alerts and begin a new reference.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: no pose has been estimated yet.
    """
    view = view_pose(session, settings, camera_id)
    if not view.told:
        raise ConflictError(f"pose: there is no estimate to accept: {view.reason}")
    close_pose_alerts(session, camera_id, "accepted", by)
    note_activity(session, "pose.accepted", by=by, camera_id=camera_id)
    from_s = tracks.newest_end_s(session, camera_id)
    renew_prior_pose(
        session, queue, settings, camera_id, view.pose, "accepted", from_s=from_s, by=by
    )
    return view_pose(session, settings, camera_id)


def reset_reference(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, by: str | None
) -> PoseView:
    """Take a person's word that the camera is back at its prior pose, and learn it anew there.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    close_pose_alerts(session, camera_id, "put_back", by)
    note_activity(session, "reference.reset", by=by, camera_id=camera_id)
    from_s = tracks.newest_end_s(session, camera_id)
    begin_reference(session, camera_id, "reset", from_s=from_s, by=by)
    request_estimate(session, queue, camera_id)
    return view_pose(session, settings, camera_id)


def _describe_window(window: MaintenanceRecord) -> str:
    until = f"maintenance is under way until {window.to_at:%Y-%m-%d %H:%M}Z"
    return f"{until} ({window.reason})" if window.reason else until


def _what_was_last(reference: SiteReferenceRecord, bounds: WindowBounds) -> str:
    put_back_s = (reference.window_from_s or 0.0) if reference.changed_s is None else 0.0
    began_s = bounds.started_from_s or 0.0
    if began_s > max(reference.from_s or 0.0, reference.to_s or 0.0, put_back_s):
        return "maintenance"
    return "camera was put back" if put_back_s else "reference"


def _state(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    estimate: EstimateRecord | None,
    so_far: int,
) -> tuple[PoseState, str]:
    if reference.ready_at is None:
        wanted = wanted_tracks(reference, settings)
        return "learning", f"{so_far} of {wanted} reference tracks"
    if estimate is None or estimate.created_at < reference.ready_at:
        bounds = window_of(session, reference, settings)
        since = tracks.count_window(session, bounds)
        text = f"{since} tracks since the {_what_was_last(reference, bounds)}; at least "
        text += f"{FEWEST_WALKERS} of people who walk for a few seconds inside the image are needed"
        return "learning", "; ".join(part for part in (text, reference.doubt) if part)
    silence = silence_of(session, settings, reference.camera_id, datetime.now(UTC))
    if silence is not None and silence.no_data:
        return "no_data", silence.reason
    return state_by(reference, estimate, silent=False), estimate.reason


def state_by(
    reference: SiteReferenceRecord, counting: EstimateRecord | None, *, silent: bool
) -> PoseState:
    """A camera's state by its newest reference, the estimate that counts, and its silence."""
    ready_at = reference.ready_at
    if ready_at is None or counting is None or counting.created_at < ready_at:
        return "learning"
    states: dict[str, PoseState] = {
        "learning": "learning",
        "drifting": "drifting",
        "out_of_range": "out_of_range",
    }
    return "no_data" if silent else states.get(counting.state, "ok")


def state_of(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    estimate: EstimateRecord | None,
) -> PoseState:
    """A camera's state alone, of its newest reference and estimate: for who asks about many."""
    counting = counting_estimate(session, settings, reference, estimate)
    return _state(session, settings, reference, counting, 0)[0]


def counting_estimate(
    session: Session,
    settings: Settings,
    reference: SiteReferenceRecord,
    estimate: EstimateRecord | None,
) -> EstimateRecord | None:
    """The newest estimate of a camera; None where it says nothing of how the camera stands now."""
    now = datetime.now(UTC)
    attended = attendance_of(session, reference.camera_id, now)
    return counting_beside(attended, settings, reference, estimate, now)


def counting_beside(
    attended: Attendance,
    settings: Settings,
    reference: SiteReferenceRecord,
    estimate: EstimateRecord | None,
    now: datetime,
) -> EstimateRecord | None:
    """The same, where it is known when somebody was at the camera."""
    if estimate is None or estimate.reference_id != reference.id:
        return None  # it was measured against a pose or a reference that no longer counts
    bounds = window_beside(attended, reference, settings)
    if reference.ready_at is None or not is_outdated(estimate, bounds):
        return estimate
    # It was put back, or somebody was at it and has gone: it may stand elsewhere.
    return estimate if attended.under_way(now) else None
