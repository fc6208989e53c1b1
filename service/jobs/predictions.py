"""What a camera's model says of its tracks: the only part of an estimate that needs torch."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from models.estimation.averaged import average_windows
from models.regression.checkpoint import load_weights
from models.regression.network import PoseRegressor
from models.regression.prediction import predict_windows
from models.regression.recipe import TrainingPlan, plan_from_config
from models.trajectory import cut_windows
from service.jobs.context import JobContext
from service.recalibration.predictions import PendingTracks, keep_predictions, take_pending
from service.store.packing import trajectory_of
from service.store.tables import TrackRecord

_BATCH = 500


def predict_pending(context: JobContext, camera_id: str) -> None:
    """Have the model in use look at all tracks of the window that it has not seen."""
    while True:
        with context.store.read() as session:
            pending = take_pending(session, context.settings, camera_id, _BATCH)
        if pending is None or not pending.tracks:
            return
        rows = _predict(context.settings.weights_dir, pending)
        with context.store.write() as session:
            keep_predictions(session, pending.model_id, rows)


def _predict(weights_dir: Path, pending: PendingTracks) -> list[dict[str, Any]]:
    """Rows of predictions, one for each track; without numbers where a track gives no window."""
    plan = plan_from_config(pending.config)
    network = _load(weights_dir, pending.weights_sha256, plan)
    windows = cut_windows(
        [trajectory_of(track) for track in pending.tracks], plan.intrinsics, plan.walk.step_s
    )
    height_m, quaternions = predict_windows(network, windows, plan)
    owners, means = average_windows(height_m, quaternions, windows.owner_idx)
    rows = _empty_rows(pending.model_id, pending.tracks)
    for place, owner in enumerate(owners):
        q = [float(value) for value in means.quaternion_wxyz[place]]
        rows[owner] |= {
            "windows": int((windows.owner_idx == owner).sum()),
            "height_m": float(means.height_m[place]),
            **dict(zip(("qw", "qx", "qy", "qz"), q, strict=True)),
        }
    return rows


def _empty_rows(model_id: str, tracks: Sequence[TrackRecord]) -> list[dict[str, Any]]:
    nothing = dict.fromkeys(("height_m", "qw", "qx", "qy", "qz"))
    return [
        {"model_id": model_id, "track_pk": track.id, "windows": 0, **nothing} for track in tracks
    ]


@lru_cache(maxsize=64)
def _load(weights_dir: Path, digest: str, plan: TrainingPlan) -> PoseRegressor:
    return load_weights(weights_dir, digest, plan.recipe)
