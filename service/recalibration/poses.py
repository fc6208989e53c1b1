"""The served pose, from the store alone; its history; accepting it."""

import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

from sqlalchemy.orm import Session

from models.estimation.averaged import FEWEST_TRACKS
from models.geometry.pose import CameraPose
from service.errors import ConflictError
from service.job_queue import JobQueue
from service.recalibration.alerts import close_pose_alerts
from service.recalibration.cameras import renew_prior_pose, require_camera
from service.settings import Settings
from service.store import cameras, estimates, tracks, trainings
from service.store.packing import pose_of_prior
from service.store.tables import EstimateRecord, ModelRecord

PoseState = Literal["learning", "ok", "drifting", "no_data", "out_of_range"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseView:
    """What is served of a camera's pose."""

    camera_id: str
    state: PoseState
    reason: str
    pose: CameraPose
    estimate: EstimateRecord | None
    model_id: str | None
    stored_tracks: int
    reference_wanted: int
    etag: str


def view_pose(session: Session, settings: Settings, camera_id: str) -> PoseView:
    """The served pose, from the store alone.

    Raises:
        NotFoundError: there is no such camera.
    """
    camera = require_camera(session, camera_id)
    prior_record = cameras.prior_pose(session, camera_id)
    prior = pose_of_prior(prior_record)
    model = trainings.newest_model(session, camera_id)
    stored = tracks.count(session, camera_id)
    estimate = estimates.newest(session, camera_id)
    if estimate is not None and estimate.prior_pose_id != prior_record.id:
        estimate = None  # it was measured against a prior pose that is no longer trusted
    state, reason = _state(session, settings, camera_id, estimate, model, stored)
    pose = prior
    if estimate is not None:
        pose = replace(
            prior,
            height_m=estimate.height_m,
            tilt_rad=estimate.tilt_rad,
            roll_rad=estimate.roll_rad,
        )
    version = 0 if estimate is None else estimate.id
    model_id = None if model is None else model.id
    return PoseView(
        camera_id=camera_id,
        state=state,
        reason=reason,
        pose=pose,
        estimate=estimate,
        model_id=model_id,
        stored_tracks=stored,
        reference_wanted=camera.reference_tracks,
        etag=f'"{prior_record.id}-{version}-{state}-{stored}-{(model_id or "none")[:8]}'
        f'-{camera.version}-{zlib.crc32(reason.encode()):08x}"',
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


def accept_pose(
    session: Session, queue: JobQueue, settings: Settings, camera_id: str, by: str | None
) -> PoseView:
    """Make the served pose the new prior pose, and close the drift alert.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: no pose has been estimated yet.
    """
    view = view_pose(session, settings, camera_id)
    if view.estimate is None:
        raise ConflictError(f"pose: there is no estimate to accept: {view.reason}")
    close_pose_alerts(session, camera_id, "accepted", by)
    renew_prior_pose(session, queue, settings, camera_id, view.pose, "accepted", by)
    return view_pose(session, settings, camera_id)


def _state(
    session: Session,
    settings: Settings,
    camera_id: str,
    estimate: EstimateRecord | None,
    model: ModelRecord | None,
    stored: int,
) -> tuple[PoseState, str]:
    newest_s = tracks.newest_end_s(session, camera_id)
    if estimate is None:
        if model is None:
            running = trainings.unfinished(session, camera_id)
            what = f"its training is {running[0].state}" if running else "no training is under way"
            return "learning", f"no model yet, {what}; {stored} tracks are stored"
        return "learning", (
            f"{stored} tracks are stored; at least {FEWEST_TRACKS} that the model can read "
            f"(11 points, {model.step_s:g} s apart, inside the image) are needed"
        )
    silent_h = (time.time() - (newest_s or 0.0)) / 3600
    if silent_h > settings.no_data_after_h:
        return "no_data", (
            f"the newest track ended {silent_h:.1f} h ago; "
            f"up to {settings.no_data_after_h:g} h are waited for"
        )
    states: dict[str, PoseState] = {"drifting": "drifting", "out_of_range": "out_of_range"}
    return states.get(estimate.state, "ok"), estimate.reason
