"""Predictions of a camera's model for its tracks, shown beside the estimate."""

import logging

from models.errors import CheckpointError
from service.estimation.evidence import Unpacked
from service.training import drop_model, fetch_weights, load_pending, save_predictions
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")

_BATCH = 500


def predict_pending(context: JobContext, camera_id: str, unpacked: Unpacked) -> str:
    """Have the model in use look at all tracks of the window that it has not seen.

    What it says is never served, so what fails here is logged and said, and stops nobody: returns
    why, or nothing. A model whose weights cannot be read is given up; the reconcile trains another.
    """
    try:
        _predict_all(context, camera_id, unpacked)
    except CheckpointError as error:
        log.error("weights_unreadable", extra={"camera_id": camera_id, "why": str(error)})
        return "the weights of its model cannot be read, and it is trained again"
    except Exception as error:
        log.exception("predictions_failed", extra={"camera_id": camera_id})
        return repr(error)
    return ""


def _predict_all(context: JobContext, camera_id: str, unpacked: Unpacked) -> None:
    while True:
        with context.store.read() as session:
            pending = load_pending(session, context.settings, camera_id, _BATCH)
        if pending is None or not pending.tracks:
            return
        fetch_weights(context.store, context.settings, pending.weights_sha256)
        from service.workers.regressor import predict  # torch: 200 MB that not every worker needs

        try:
            rows = predict(context.settings.weights_dir, pending, unpacked)
        except CheckpointError:
            with context.store.write(camera_id) as session:
                drop_model(session, pending.model_id)
            raise
        with context.store.write(camera_id) as session:
            save_predictions(session, pending.model_id, rows)
