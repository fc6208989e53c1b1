"""The trained regressors at work: the only part of an estimate that needs torch."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import torch

from models.regression.averaging import average_windows
from models.regression.checkpoint import load_weights
from models.regression.network import PoseRegressor, predict_windows
from models.regression.recipe import TrainingPlan, plan_from_config
from models.tracks.trajectory import cut_windows
from service.estimation.evidence import Unpacked
from service.store.tracks import StoredTrack
from service.training import PendingTracks

_NETWORKS = 64  # kept in memory, of the cameras that were looked at last

torch.set_num_threads(1)  # these networks are small: more threads wait for one another


def predict(weights_dir: Path, pending: PendingTracks, unpacked: Unpacked) -> list[dict[str, Any]]:
    """Rows of predictions, one for each track; without numbers where a track gives no window.

    Raises:
        CheckpointError: the model's weights or plan cannot be read.
    """
    plan = plan_from_config(pending.model.config)
    network = _load(weights_dir, pending.model.weights_sha256, plan)
    windows = cut_windows(
        [unpacked.feet(track) for track in pending.tracks], plan.intrinsics, plan.walk.step_s
    )
    height_m, quaternions = predict_windows(network, windows, plan)
    owners, means = average_windows(height_m, quaternions, windows.owner_idx)
    rows = _empty_rows(pending.model.id, pending.tracks)
    for place, owner in enumerate(owners):
        q = [float(value) for value in means.quaternion_wxyz[place]]
        rows[owner] |= {
            "windows": int((windows.owner_idx == owner).sum()),
            "height_m": float(means.height_m[place]),
            **dict(zip(("qw", "qx", "qy", "qz"), q, strict=True)),
        }
    return rows


def _empty_rows(model_id: str, tracks: Sequence[StoredTrack]) -> list[dict[str, Any]]:
    nothing = dict.fromkeys(("height_m", "qw", "qx", "qy", "qz"))
    return [
        {"model_id": model_id, "track_pk": track.id, "windows": 0, **nothing} for track in tracks
    ]


@lru_cache(maxsize=_NETWORKS)
def _load(weights_dir: Path, digest: str, plan: TrainingPlan) -> PoseRegressor:
    return load_weights(weights_dir, digest, plan.recipe)
