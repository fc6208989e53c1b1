"""Trainings of the regressors: queued, watched, published; what the models in use say of tracks.

All that others may call can be imported from here.
"""

from service.training.automatic import (
    StepWatch,
    requeue_lost,
    train_at_edge,
    train_by_itself,
    train_if_needed,
)
from service.training.predictions import (
    PendingTracks,
    drop_model,
    fetch_weights,
    load_pending,
    save_predictions,
    share_weights,
)
from service.training.trainings import (
    TrainingAttempt,
    begin_training,
    cancel_training,
    end_training,
    is_wanted,
    list_trainings,
    publish_model,
    report_progress,
    request_training,
    show_training,
    stop_trainings,
)

__all__ = [
    "PendingTracks",
    "StepWatch",
    "TrainingAttempt",
    "begin_training",
    "cancel_training",
    "drop_model",
    "end_training",
    "fetch_weights",
    "is_wanted",
    "list_trainings",
    "load_pending",
    "publish_model",
    "report_progress",
    "request_training",
    "requeue_lost",
    "save_predictions",
    "share_weights",
    "show_training",
    "stop_trainings",
    "train_at_edge",
    "train_by_itself",
    "train_if_needed",
]
