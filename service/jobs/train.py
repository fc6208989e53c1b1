"""The training job: minutes of CPU, no transaction open, published in one at its end."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import asdict

from models.errors import CalibrationError
from models.regression.checkpoint import save_weights
from models.regression.training import TrainingProgress, check_held_out, train
from service.jobs.context import JobContext
from service.recalibration.trainings import (
    TrainingAttempt,
    begin_training,
    end_training,
    publish_model,
    report_progress,
)

log = logging.getLogger("surefoot.jobs")
_REPORT_EVERY_S = 0.5


class TrainingStoppedError(Exception):
    """The training was cancelled, or another attempt has taken it over."""


def run_training(context: JobContext, training_id: str) -> None:
    """Carry out a queued training. Harmless when run twice: an ended training is left alone."""
    with context.store.write() as session:
        attempt = begin_training(session, context.settings, training_id)
    if attempt is None:
        return
    fields = {"camera_id": attempt.camera_id, "job_id": training_id, "attempt": attempt.attempt}
    log.info("training_started", extra=fields)
    try:
        network, metrics = train(attempt.plan, _reporter(context, attempt))
        check_held_out(metrics)
        digest = save_weights(network, context.settings.weights_dir)
    except TrainingStoppedError:
        log.info("training_cancelled", extra=fields)
        with context.store.write() as session:
            end_training(session, attempt, "cancelled")
        return
    except Exception as error:
        foreseen = isinstance(error, CalibrationError)
        log.log(
            logging.WARNING if foreseen else logging.ERROR,
            "training_failed",
            extra=fields,
            exc_info=None if foreseen else error,
        )
        with context.store.write() as session:
            end_training(session, attempt, "failed", str(error) or repr(error))
        return
    with context.store.write() as session:
        publish_model(
            session, context.queue, attempt, weights_sha256=digest, metrics=asdict(metrics)
        )
    log.info("training_ended", extra=fields)


def _reporter(context: JobContext, attempt: TrainingAttempt) -> Callable[[TrainingProgress], None]:
    """A callback that writes progress twice a second and ends a training that is to stop."""
    reported_at = 0.0

    def report(progress: TrainingProgress) -> None:
        nonlocal reported_at
        if context.stopping.is_set():
            # The process is about to end. Coming back from here would end the job as done; left
            # where it is, the engine runs it again at the next start.
            threading.Event().wait()
        now = time.monotonic()
        if now - reported_at < _REPORT_EVERY_S:
            return
        reported_at = now
        with context.store.write() as session:
            goes_on = report_progress(
                session, attempt, progress.step, progress.steps, progress.loss, progress.eta_s
            )
        if not goes_on:
            raise TrainingStoppedError(attempt.training_id)

    return report
