"""Weights that several machines share, and what the model in use says of tracks."""

import hashlib
import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from models.regression.weights_files import weights_path
from service.references import window_of
from service.settings import Settings
from service.store import references, tracks, trainings, windows
from service.store.engines.store import Store
from service.store.tracks import StoredTrack

log = logging.getLogger("surefoot.jobs")


def share_weights(session: Session, settings: Settings, sha256: str) -> None:
    """Keep weights beside the model that is published with them, where there is a server."""
    if settings.database_url is not None and not trainings.has_weights(session, sha256):
        trainings.keep_weights(
            session, sha256, weights_path(settings.weights_dir, sha256).read_bytes()
        )


def fetch_weights(store: Store, settings: Settings, sha256: str) -> None:
    """See that weights are on this machine's disk, if they are anywhere; whole or not at all."""
    path = weights_path(settings.weights_dir, sha256)
    if settings.database_url is None or path.exists():
        return
    with store.read() as session:
        data = trainings.weights(session, sha256)
    if data is None or hashlib.sha256(data).hexdigest() != sha256:
        return  # who reads the file says that it cannot
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.fetched")
    partial.write_bytes(data)
    partial.replace(path)
    log.info("weights_fetched", extra={"sha256": sha256, "bytes": len(data)})


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingTracks:
    """Tracks without a prediction, and the model that is to look at them."""

    model_id: str
    weights_sha256: str
    config: dict[str, Any]
    tracks: Sequence[StoredTrack]


def load_pending(
    session: Session, settings: Settings, camera_id: str, limit: int
) -> PendingTracks | None:
    """Tracks of the window that the model in use has not seen; None without model or camera."""
    reference = references.newest_if_any(session, camera_id)
    model = trainings.newest_model(session, camera_id)
    if model is None or reference is None:
        return None
    bounds = window_of(session, reference, settings)
    return PendingTracks(
        model_id=model.id,
        weights_sha256=model.weights_sha256,
        config=model.config,
        tracks=windows.without_prediction(session, bounds, model.id, limit),
    )


def save_predictions(session: Session, model_id: str, rows: Sequence[dict[str, Any]]) -> None:
    """Store predictions, of those tracks and that model that still exist."""
    existing = tracks.existing(session, [row["track_pk"] for row in rows])
    if trainings.model_exists(session, model_id):
        windows.add_predictions(session, [row for row in rows if row["track_pk"] in existing])


def drop_model(session: Session, model_id: str) -> None:
    """Take a model whose weights cannot be read out of use; the reconcile has another trained."""
    trainings.delete_model(session, model_id)
