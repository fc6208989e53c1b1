"""Which tracks a model has yet to look at, and what it says of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from service.settings import Settings
from service.store import predictions, references, tracks, trainings
from service.store.stored_tracks import StoredTrack
from service.windows.references import window_of


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
        tracks=predictions.without_prediction(session, bounds, model.id, limit),
    )


def save_predictions(session: Session, model_id: str, rows: Sequence[dict[str, Any]]) -> None:
    """Store predictions, of those tracks and that model that still exist."""
    existing = tracks.existing(session, [row["track_pk"] for row in rows])
    if trainings.model_exists(session, model_id):
        predictions.add_predictions(session, [row for row in rows if row["track_pk"] in existing])


def drop_model(session: Session, model_id: str) -> None:
    """Take a model whose weights cannot be read out of use; the reconcile has another trained."""
    trainings.delete_model(session, model_id)
