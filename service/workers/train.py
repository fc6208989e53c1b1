"""The training job: minutes of CPU elsewhere, no transaction open, published in one at its end."""

import logging
import threading
from collections.abc import Callable
from functools import partial

from models.errors import CalibrationError
from service.enums import TrainingState
from service.training import (
    TrainingAttempt,
    begin_training,
    end_training,
    is_wanted,
    publish_model,
    report_progress,
    share_weights,
)
from service.workers.context import JobContext
from service.workers.training_child import Progress, Trained, TrainingDiedError, train_apart

log = logging.getLogger("surefoot.jobs")
_TRIES = 3  # of processes that die: by a lack of memory, say


class TrainingStoppedError(Exception):
    """The training was cancelled, or another attempt has taken it over."""


def run_training(context: JobContext, training_id: str) -> None:
    """Carry out a queued training. Harmless when run twice: an ended training is left alone."""
    for left in reversed(range(_TRIES)):
        with context.store.write() as session:
            attempt = begin_training(session, context.settings, training_id)
        if attempt is None:
            return
        try:
            _carry_out(context, attempt)
            return
        except TrainingDiedError as error:
            fields = {"camera_id": attempt.camera_id, "job_id": training_id, "why": str(error)}
            log.error("training_died", extra=fields)
            if not left:
                with context.store.write(attempt.camera_id) as session:
                    end_training(session, attempt, TrainingState.FAILED, str(error))


def _carry_out(context: JobContext, attempt: TrainingAttempt) -> None:
    fields = {
        "camera_id": attempt.camera_id,
        "job_id": attempt.training_id,
        "attempt": attempt.attempt,
    }
    log.info("training_started", extra=fields)
    try:
        trained = _train(context, attempt)
    except TrainingStoppedError:
        log.info("training_cancelled", extra=fields)
        with context.store.write(attempt.camera_id) as session:
            end_training(session, attempt, TrainingState.CANCELLED)
        return
    except TrainingDiedError:
        raise
    except Exception as error:
        foreseen = isinstance(error, CalibrationError)
        log.log(
            logging.WARNING if foreseen else logging.ERROR,
            "training_failed",
            extra=fields,
            exc_info=None if foreseen else error,
        )
        with context.store.write(attempt.camera_id) as session:
            end_training(session, attempt, TrainingState.FAILED, str(error) or repr(error))
        return
    with context.store.write(attempt.camera_id) as session:
        share_weights(session, context.settings, trained.weights_sha256)
        publish_model(
            session,
            context.queue,
            attempt,
            weights_sha256=trained.weights_sha256,
            metrics=trained.metrics,
        )
    log.info("training_ended", extra=fields)


class _ParkedError(Exception):
    """The worker is about to end, and the training with it."""


def _train(context: JobContext, attempt: TrainingAttempt) -> Trained:
    try:
        return train_apart(
            attempt.plan,
            context.settings,
            _reporter(context, attempt),
            partial(may_go_on, context),
        )
    except _ParkedError:
        # Coming back from here would end the job as done; left where it is, the engine runs it
        # again at the next start.
        threading.Event().wait()
        raise


def may_go_on(context: JobContext) -> bool:
    """True where a training is in nobody's way: an estimate that waits for a worker goes first."""
    if context.settings.trainings != "idle":
        return True
    with context.store.read() as session:
        return not context.queue.estimates_wait(session)


def _reporter(context: JobContext, attempt: TrainingAttempt) -> Callable[[Progress | None], None]:
    """A callback that writes progress and ends a training that is to stop."""
    written: Progress | None = None

    def report(progress: Progress | None) -> None:
        nonlocal written
        if context.stopping.is_set():
            raise _ParkedError
        if progress is None or progress == written:
            with context.store.read() as session:
                goes_on = is_wanted(session, attempt)
        else:
            written = progress
            with context.store.write(attempt.camera_id) as session:
                goes_on = report_progress(
                    session, attempt, progress.step, progress.steps, progress.loss, progress.eta_s
                )
        if not goes_on:
            raise TrainingStoppedError(attempt.training_id)

    return report
