"""From tracks that a model has yet to look at to a stored estimate and its alert."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.drift.verdict import Drift, DriftLimits, drift_between, judge
from models.estimation.averaged import (
    FEWEST_TRACKS,
    PoseEstimate,
    TrackPredictions,
    averaged_estimate,
    pose_of,
)
from models.geometry.pose import CameraPose
from service.recalibration.alerts import close_pose_alerts, open_alert
from service.settings import Settings
from service.store import alerts, cameras, estimates, events, tracks, trainings
from service.store.packing import pose_of_prior
from service.store.tables import EstimateRecord, ModelRecord, PredictionRecord, TrackRecord

_EDGE = 0.9  # of the training range: beyond, a regressor only knows "at least so much"


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingTracks:
    """Tracks without a prediction, and the model that is to look at them."""

    model_id: str
    weights_sha256: str
    config: dict[str, Any]
    tracks: Sequence[TrackRecord]


def take_pending(
    session: Session, settings: Settings, camera_id: str, limit: int
) -> PendingTracks | None:
    """Take the mark "due" off a camera and name its pending tracks; None without any or model."""
    camera = cameras.find(session, camera_id)
    if camera is None:
        return None
    camera.estimate_due_at = None
    model = trainings.newest_model(session, camera_id)
    window = tracks.window(session, camera_id, settings.window_tracks, settings.window_days)
    if model is None or window is None:
        return None
    return PendingTracks(
        model_id=model.id,
        weights_sha256=model.weights_sha256,
        config=model.config,
        tracks=tracks.without_prediction(session, camera_id, model.id, window, limit),
    )


def keep_predictions(session: Session, model_id: str, rows: Sequence[dict[str, Any]]) -> None:
    """Store predictions, of those tracks and that model that still exist."""
    existing = tracks.existing(session, [row["track_pk"] for row in rows])
    if trainings.model_exists(session, model_id):
        tracks.add_predictions(session, [row for row in rows if row["track_pk"] in existing])


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
    if last is not None and (last.model_id, last.prior_pose_id) != (model.id, prior_record.id):
        last = None  # a streak belongs to one model and one prior pose
    if last is not None and (last.newest_track_pk, last.tracks) == (
        window.newest_pk,
        len(predictions),
    ):
        return None
    estimate = averaged_estimate(_as_predictions(predictions), settings.seed)
    prior = pose_of_prior(prior_record)
    drift = drift_between(estimate, prior)
    limits = _limits(settings)
    was_drifting = alerts.firing(session, camera_id, "drift") is not None
    streak = 0 if last is None else last.drift_streak
    if last is not None and last.state == "drifting" and not was_drifting:
        streak = 0  # a person resolved the alert: it has to earn its updates anew
    verdict = judge(drift, estimate, limits, streak, was_drifting)
    since = None
    if verdict.streak > 0 or verdict.drifting:
        known = None if last is None else last.drift_since
        since = known or datetime.fromtimestamp(window.to_s, UTC)
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
        close_pose_alerts(session, camera_id, "cleared", None)
    return record


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
