"""The served pose: from predictions to a stored estimate, and from there to an answer."""

import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from sqlalchemy.orm import Session

from models.drift import Drift, DriftLimits, drift_between, judge
from models.estimation.averaged import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
    pose_of,
)
from models.geometry.pose import CameraPose
from service.errors import ConflictError
from service.job_queue import JobQueue
from service.recalibration.alerts import close_alert, open_alert
from service.recalibration.cameras import add_prior_pose, require_camera
from service.recalibration.trainings import queue_training, stop_trainings
from service.settings import Settings
from service.store import alerts, cameras, estimates, events, tracks, trainings
from service.store.packing import pose_of_prior
from service.store.tables import EstimateRecord, ModelRecord, PredictionRecord

PoseState = Literal["learning", "ok", "drifting", "no_data", "out_of_range"]
_EDGE = 0.9  # of the training range: beyond, a regressor only knows "at least so much"


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
        pose = CameraPose(
            height_m=estimate.height_m,
            tilt_rad=estimate.tilt_rad,
            roll_rad=estimate.roll_rad,
            heading_rad=prior.heading_rad,
            x_m=prior.x_m,
            y_m=prior.y_m,
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
    add_prior_pose(session, camera_id, view.pose, "accepted", by)
    close_alert(session, camera_id, "drift", "accepted", by)
    close_alert(session, camera_id, "out_of_range", "accepted", by)
    stop_trainings(session, camera_id)
    queue_training(session, queue, settings, camera_id)
    return view_pose(session, settings, camera_id)


def store_estimate(session: Session, settings: Settings, camera_id: str) -> EstimateRecord | None:
    """Average the predictions of the window, judge the drift, store both; None if it is too early.

    Harmless when run twice: without a new track, model or prior pose nothing is written.
    """
    model = trainings.newest_model(session, camera_id)
    window = tracks.window(session, camera_id, settings.window_tracks, settings.window_days)
    if model is None or window is None:
        return None
    predictions = tracks.predictions(session, camera_id, model.id, window)
    if len(predictions) < FEWEST_TRACKS:
        return None
    prior_record = cameras.prior_pose(session, camera_id)
    last = estimates.newest(session, camera_id)
    if (
        last is not None
        and (last.model_id, last.prior_pose_id) == (model.id, prior_record.id)
        and (last.newest_track_pk, last.tracks) == (window.newest_pk, len(predictions))
    ):
        return None
    estimate = averaged_estimate(_as_predictions(predictions), settings.seed)
    prior = pose_of_prior(prior_record)
    drift = drift_between(estimate, prior)
    # A streak belongs to one model and one prior pose.
    goes_on = last is not None and (last.model_id, last.prior_pose_id) == (
        model.id,
        prior_record.id,
    )
    limits = _limits(settings)
    was_drifting = alerts.firing(session, camera_id, "drift") is not None
    streak = last.drift_streak if goes_on and last is not None else 0
    if last is not None and last.state == "drifting" and not was_drifting:
        streak = 0  # a person resolved the alert: it has to earn its updates anew
    verdict = judge(drift, estimate, limits, streak, was_drifting)
    since = None
    if verdict.streak > 0 or verdict.drifting:
        since = last.drift_since if goes_on and last is not None else None
        since = since or datetime.fromtimestamp(window.to_s, UTC)
    edge = _beyond_range(estimate, model)
    state = "out_of_range" if edge else "drifting" if verdict.drifting else "ok"
    reason = edge or _describe(drift, estimate, verdict.drifting, verdict.streak, limits)
    now = datetime.now(UTC)
    record = EstimateRecord(
        camera_id=camera_id,
        model_id=model.id,
        prior_pose_id=prior_record.id,
        state=state,
        reason=reason,
        **_served_columns(estimate, prior),
        drift_height_m=drift.height_m,
        drift_tilt_rad=drift.tilt_rad,
        drift_roll_rad=drift.roll_rad,
        drift_angle_rad=drift.angle_rad,
        drift_streak=verdict.streak,
        drift_since=since,
        raw={"averaged": _raw(estimate)},
        tracks=len(predictions),
        from_s=window.from_s,
        to_s=window.to_s,
        newest_track_pk=window.newest_pk,
        created_at=now,
    )
    session.add(record)
    events.add(
        session,
        "pose",
        {"camera_id": camera_id, "state": state, "tracks": record.tracks, "drift": _drift(drift)},
        now,
    )
    if verdict.drifting or edge:
        kind = "out_of_range" if edge else "drift"
        severity = "critical" if edge or verdict.excess >= 2 else "warning"
        open_alert(session, camera_id, kind, severity, _drift(drift), since)
    else:
        close_alert(session, camera_id, "drift", "cleared", None)
        close_alert(session, camera_id, "out_of_range", "cleared", None)
    return record


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


def _describe(
    drift: Drift, estimate: PoseEstimate, drifting: bool, streak: int, limits: DriftLimits
) -> str:
    text = (
        f"tilt {_deg(drift.tilt_rad)} deg (sd {np.degrees(estimate.tilt_sd_rad):.2f}), roll "
        f"{_deg(drift.roll_rad)} deg (sd {np.degrees(estimate.roll_sd_rad):.2f}), height "
        f"{drift.height_m:+.2f} m (sd {estimate.height_sd_m:.2f}) against the prior pose"
    )
    limit = f"{limits.sigmas:g} sd and {np.degrees(limits.floor_rad):g} deg or {limits.floor_m:g} m"
    if drifting:
        return f"{text}: beyond {limit} for {limits.updates} updates"
    if streak > 0:
        return f"{text}: beyond {limit}, {streak} of {limits.updates} updates"
    return f"{text}: not beyond {limit}"


def _beyond_range(estimate: PoseEstimate, model: ModelRecord) -> str | None:
    """In words, where the estimate is at the edge of what the model was trained for."""
    prior, spread = model.config["prior_pose"], model.config["recipe"]["spread"]
    for name, value, reach in (
        ("height", estimate.height_m - prior["height_m"], spread["height_m"]),
        ("tilt", estimate.tilt_rad - prior["tilt_rad"], spread["angle_rad"]),
        ("roll", estimate.roll_rad - prior["roll_rad"], spread["angle_rad"]),
    ):
        if abs(value) > _EDGE * reach:
            return f"{name} is at the edge of the training range; the move is at least so large"
    return None


def _as_predictions(records: Sequence[PredictionRecord]) -> TrackPredictions:
    return TrackPredictions(
        height_m=np.array([record.height_m for record in records], dtype=np.float64),
        quaternion_wxyz=np.array([(r.qw, r.qx, r.qy, r.qz) for r in records], dtype=np.float64),
    )


def _served_columns(estimate: PoseEstimate, prior: CameraPose) -> dict[str, float]:
    pose = pose_of(estimate, prior)
    return {
        "height_m": pose.height_m,
        "tilt_rad": pose.tilt_rad,
        "roll_rad": pose.roll_rad,
        "height_sd_m": estimate.height_sd_m,
        "tilt_sd_rad": estimate.tilt_sd_rad,
        "roll_sd_rad": estimate.roll_sd_rad,
    }


def _raw(estimate: PoseEstimate) -> dict[str, Any]:
    return {
        "height_m": estimate.height_m,
        "tilt_deg": float(np.degrees(estimate.tilt_rad)),
        "roll_deg": float(np.degrees(estimate.roll_rad)),
        "tracks": estimate.tracks,
    }


def _drift(drift: Drift) -> dict[str, float]:
    return {
        "height_m": drift.height_m,
        "tilt_deg": float(np.degrees(drift.tilt_rad)),
        "roll_deg": float(np.degrees(drift.roll_rad)),
        "angle_deg": float(np.degrees(drift.angle_rad)),
    }


def _limits(settings: Settings) -> DriftLimits:
    return DriftLimits(
        sigmas=settings.drift_sigmas,
        floor_rad=float(np.radians(settings.drift_floor_deg)),
        floor_m=settings.drift_floor_m,
        updates=settings.drift_updates,
        clear_ratio=settings.drift_clear_ratio,
    )


def _deg(angle_rad: float) -> str:
    return f"{np.degrees(angle_rad):+.2f}"
