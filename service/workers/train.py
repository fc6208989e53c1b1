"""The training job: minutes of CPU in a process of its own, published in one transaction."""

import contextlib
import json
import logging
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from models.errors import CalibrationError
from models.regression.recipe import TrainingPlan, TrainingProgress, plan_to_config
from service.enums import TrainingState
from service.interpreter import command_of
from service.settings import Settings
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
from service.workers.processes.exits import words_of
from service.workers.training_process import GO_ON, REST

log = logging.getLogger("surefoot.jobs")

_TICK_S = 0.5
_TRIES = 3  # of processes that die: by a lack of memory, say


class TrainingDiedError(RuntimeError):
    """The process of a training ended without an answer: killed, or out of memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """The outcome of a training: a weights file, and its errors on held-out walks."""

    weights_sha256: str
    metrics: dict[str, Any]


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


def _reporter(
    context: JobContext, attempt: TrainingAttempt
) -> Callable[[TrainingProgress | None], None]:
    """A callback that writes progress and ends a training that is to stop."""
    written: TrainingProgress | None = None

    def report(progress: TrainingProgress | None) -> None:
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


def train_apart(
    plan: TrainingPlan,
    settings: Settings,
    on_tick: Callable[[TrainingProgress | None], None],
    may_go_on: Callable[[], bool] = lambda: True,
) -> Trained:
    """Train in a process of its own; what `on_tick` raises ends it.

    `on_tick` is called twice a second with the newest progress, None before there is any, and
    `may_go_on` asked as often; while it says no, the training rests between two of its steps.

    Raises:
        CalibrationError: the plan cannot be trained, or what came of it is no good.
        TrainingDiedError: the process ended without an answer.
    """
    order = {
        "config": plan_to_config(plan),
        "weights_dir": str(settings.weights_dir),
        "threads": settings.training_threads,
        "nice": settings.training_nice,
    }
    ends_s = time.monotonic() + settings.training_limit_s
    progress: TrainingProgress | None = None
    resting = False
    with _process(order, settings) as (process, lines):
        while True:
            with contextlib.suppress(queue.Empty):
                line = lines.get(timeout=_TICK_S)
                if line is None:
                    raise TrainingDiedError(f"its process {words_of(process.wait())}")
                if "error" in line:
                    raise CalibrationError(line["error"])
                if "metrics" in line:
                    return Trained(**line)
                progress = TrainingProgress(**line["progress"])
            on_tick(progress)
            if may_go_on() == resting:
                resting = not resting
                log.info("training_rests" if resting else "training_goes_on")
                _tell(process, REST if resting else GO_ON)
            if resting:
                ends_s += _TICK_S
            if time.monotonic() > ends_s:
                raise CalibrationError(
                    f"training: more than {settings.training_limit_s:g} s, which are the limit"
                )


def _tell(process: "subprocess.Popen[bytes]", line: str) -> None:
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):  # it died at once, which its status tells
        process.stdin.write(line.encode() + b"\n")
        process.stdin.flush()


@contextmanager
def _process(
    order: dict[str, Any], settings: Settings
) -> Iterator[tuple[subprocess.Popen[bytes], "queue.Queue[dict[str, Any] | None]"]]:
    process = subprocess.Popen(
        command_of("service.workers.training_process"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=settings.as_environment(),
    )
    lines: queue.Queue[dict[str, Any] | None] = queue.Queue()
    try:
        _tell(process, json.dumps(order))
        threading.Thread(target=_listen, args=(process, lines), daemon=True).start()
        yield process, lines
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


def _listen(process: subprocess.Popen[bytes], lines: "queue.Queue[dict[str, Any] | None]") -> None:
    """Hand on what the process says; None at its end, a line cut short by its death included."""
    assert process.stdout is not None
    try:
        for line in process.stdout:
            lines.put(json.loads(line))
    except ValueError:
        pass
    lines.put(None)
