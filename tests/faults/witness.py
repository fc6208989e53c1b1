"""Loaded into every worker (as `sitecustomize`): two runs of one job at once leave a line behind.

Each run of a job holds a file lock, which the kernel takes back however its process ends: a lock
that is taken is a process that lives and runs the same job of the same camera or webhook.
"""

import fcntl
import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

_FOLDER = Path(os.environ["FAULTS_WITNESS"])
_JOBS = (
    ("service.workers.estimate", "run_estimate"),
    ("service.workers.train", "run_training"),
    ("service.workers.deliver", "run_deliver"),
)


def _say(line: str) -> None:
    with (_FOLDER / "lines").open("a") as lines:
        lines.write(line + "\n")


def _is_stopped(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] in "Tt"
    except (OSError, IndexError):
        return False


def _is_cut(pid: str) -> bool:
    """Whether a process is of the machine that is cut off from the database by now."""
    try:
        cut = (_FOLDER / "cut").read_bytes()
        return b"SUREFOOT_DATA_DIR=" + cut in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return False


def _kind(pid: str) -> str:
    if _is_stopped(pid):
        return "beside_a_stopped_one"
    return "beside_a_cut_one" if _is_cut(pid) else "twice_at_once"


def _watched(name: str, job: Callable[..., Any]) -> Callable[..., Any]:
    def run(context: Any, key: str, *more: Any) -> Any:
        with (_FOLDER / f"{name}-{key}.lock").open("a+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                lock.seek(0)
                pid = lock.read().strip()
                _say(f"{_kind(pid)} {name} {key} {pid} {os.getpid()}")
                return job(context, key, *more)
            lock.truncate(0)
            lock.write(str(os.getpid()))
            lock.flush()
            _say(f"run {name} {key}")
            return job(context, key, *more)

    run.__name__ = job.__name__
    return run


if "worker" in sys.orig_argv:
    for module, name in _JOBS:
        try:
            there = importlib.import_module(module)
            setattr(there, name, _watched(name, getattr(there, name)))
        except (ImportError, AttributeError) as error:
            _say(f"blind {name} {error}")
