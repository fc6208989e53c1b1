"""The worker's end of a training's process: starts it, listens to it, ends it."""

import contextlib
import json
import logging
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from models.errors import CalibrationError
from models.regression.recipe import TrainingPlan, plan_to_config
from service.settings import Settings
from service.workers.processes.exits import words_of

log = logging.getLogger("surefoot.jobs")

_TICK_S = 0.5
REST, GO_ON = "rest", "go on"  # what a training is told, beside its order


class TrainingDiedError(RuntimeError):
    """The process of a training ended without an answer: killed, or out of memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """The progress of a training."""

    step: int
    steps: int
    loss: float
    eta_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """The outcome of a training: a weights file, and its errors on held-out walks."""

    weights_sha256: str
    metrics: dict[str, Any]


def train_apart(
    plan: TrainingPlan,
    settings: Settings,
    on_tick: Callable[[Progress | None], None],
    may_go_on: Callable[[], bool] = lambda: True,
) -> Trained:
    """Train in a process of its own; what `on_tick` raises ends it.

    Args:
        plan: what to train.
        settings: where weights go, threads and limit.
        on_tick: called twice a second with the newest progress, None before there is any.
        may_go_on: asked as often; while it says no, the training rests between two of its steps.

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
    progress: Progress | None = None
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
                progress = Progress(**line["progress"])
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
        [sys.executable, "-m", "service.workers.training_process"],
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
