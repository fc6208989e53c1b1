"""Weights that several machines share, and what the model in use says of tracks."""

import hashlib
import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from models.regression.recipe import weights_path
from service.references import window_of
from service.settings import Settings
from service.store import references, tracks, trainings, windows
from service.store.engines.store import Store
from service.store.run_budget import RunBudget
from service.store.tracks import StoredTrack
from service.store.trainings import ModelRecord, WeightsRecord

log = logging.getLogger("surefoot.jobs")


def share_weights(session: Session, settings: Settings, sha256: str) -> None:
    """Keep weights beside the model that is published with them, where there is a server."""
    if settings.database_url is not None and session.get(WeightsRecord, sha256) is None:
        data = weights_path(settings.weights_dir, sha256).read_bytes()
        session.add(WeightsRecord(sha256=sha256, data=data, stored_at=datetime.now(UTC)))


def fetch_weights(store: Store, settings: Settings, sha256: str) -> None:
    """See that weights are on this machine's disk, if they are anywhere; whole or not at all."""
    path = weights_path(settings.weights_dir, sha256)
    if settings.database_url is None or path.exists():
        return
    with store.read() as session:
        kept = session.get(WeightsRecord, sha256)
    if kept is None or hashlib.sha256(kept.data).hexdigest() != sha256:
        return  # who reads the file says that it cannot
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.fetched")
    partial.write_bytes(kept.data)
    partial.replace(path)
    log.info("weights_fetched", extra={"sha256": sha256, "bytes": len(kept.data)})


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingTracks:
    """Tracks without a prediction, and the model that is to look at them."""

    model: ModelRecord
    tracks: Sequence[StoredTrack]


def load_pending(
    session: Session,
    settings: Settings,
    camera_id: str,
    limit: int,
    budget: RunBudget | None = None,
) -> PendingTracks | None:
    """Tracks of the window that the model in use has not seen; None without model or camera."""
    reference = references.newest_if_any(session, camera_id)
    model = trainings.newest_model(session, camera_id)
    if model is None or reference is None:
        return None
    bounds = window_of(session, reference, settings)
    return PendingTracks(
        model=model,
        tracks=windows.without_prediction(session, bounds, model.id, limit, budget),
    )


def save_predictions(session: Session, model_id: str, rows: Sequence[dict[str, Any]]) -> None:
    """Store predictions, of those tracks and that model that still exist."""
    existing = tracks.existing(session, [row["track_pk"] for row in rows])
    if session.get(ModelRecord, model_id) is not None:
        windows.add_predictions(session, [row for row in rows if row["track_pk"] in existing])


def drop_model(session: Session, model_id: str) -> None:
    """Take a model whose weights cannot be read out of use; the reconcile has another trained."""
    model = session.get(ModelRecord, model_id)
    if model is not None:
        session.delete(model)
