"""The workers that `surefoot serve` starts, minds and ends."""

import contextlib
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import IO, Self

from sqlalchemy.exc import SQLAlchemyError

from service.errors import OverloadedError
from service.settings import Settings
from service.store.engines.store import Store
from service.workers.processes import exits
from service.workers.processes.workers import WORKERS, note_trouble, worker_name

log = logging.getLogger("surefoot.serve")

_WORKER_STOP_S = 10.0
_TICK_S = 0.2
_START_S = 120.0  # until its first sign of life: on a busy machine its imports take a while
_SETTLED_S = 60.0  # who lives for so long did not die of how it starts
_LONGEST_PAUSE_S = 60.0
_REPORTED_FROM = 3  # deaths in a row


def pause_s(deaths: int) -> float:
    """The pause before a worker is started again that died so often in a row."""
    return float(min(2.0 ** min(deaths - 1, 20), _LONGEST_PAUSE_S))


class LocalWorkers:
    """Worker processes that live and die with this one; one that dies or hangs is started anew.

    Each reads its stdin, whose other end is ours: when this process ends in whatever way, even by
    `kill -9`, the workers end too. Each tells on its stdout that it lives. `give_up` is called
    where that makes no sense: other processes work under their names.
    """

    def __init__(self, settings: Settings, give_up: Callable[[], None]) -> None:
        self.refused = False
        self._settings = settings
        self._give_up = give_up
        self._store = Store(settings)
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(
                target=self._keep, args=(worker_name(settings, f"local-{number}"),), daemon=True
            )
            for number in range(settings.workers)
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        for thread in self._threads:
            thread.join()
        self._store.close()

    def _keep(self, name: str) -> None:
        deaths = 0
        self._say(name, None)
        while not self._stopping.is_set():
            begun_s = time.monotonic()
            status = self._run(name, reported=deaths >= _REPORTED_FROM)
            if self._stopping.is_set():
                return
            if status == exits.REFUSED:
                log.error("worker_refused", extra={"worker": name, "why": exits.words_of(status)})
                self.refused = True
                self._give_up()
                return
            deaths = 1 if time.monotonic() - begun_s > _SETTLED_S else deaths + 1
            rest_s = pause_s(deaths)
            words = exits.words_of(status)
            fields = {"worker": name, "status": status, "why": words, "again_in_s": rest_s}
            log.warning("worker_ended", extra=fields)
            if deaths >= _REPORTED_FROM:
                self._say(
                    name, f"died {deaths} times in a row: {words}; started every {rest_s:g} s"
                )
            self._stopping.wait(rest_s)

    def _run(self, name: str, *, reported: bool) -> int:
        """Run a worker until it ends, hangs or is to end; returns its exit status."""
        with subprocess.Popen(
            [sys.executable, "-m", "service.cli", "worker", "--name", name, "--follow-stdin"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=self._settings.as_environment(),
        ) as process:
            beats = _Heartbeat(process.stdout)
            begun_s = time.monotonic()
            while process.poll() is None and not self._stopping.wait(_TICK_S):
                limit_s = self._settings.worker_lost_s if beats.heard else _START_S
                if beats.silent_s > limit_s:
                    fields = {"worker": name, "pid": process.pid, "silent_s": limit_s}
                    log.error("worker_hangs", extra=fields)
                    process.kill()
                    process.wait()
                if reported and time.monotonic() - begun_s > _SETTLED_S:
                    self._say(name, None)
                    reported = False
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(_WORKER_STOP_S)
                except subprocess.TimeoutExpired:
                    process.kill()
            return process.wait()

    def _say(self, name: str, trouble: str | None) -> None:
        """Have `/readyz` say what is wrong with a worker, or nothing."""
        try:
            with self._store.write(WORKERS) as session:
                note_trouble(session, name, trouble)
        except (SQLAlchemyError, OverloadedError) as error:
            log.warning("trouble_not_noted", extra={"worker": name, "why": str(error)})


class _Heartbeat:
    """The signs of life that a worker writes on its stdout, by the monotonic clock."""

    def __init__(self, pipe: IO[bytes] | None) -> None:
        assert pipe is not None
        self.heard = False
        self._last_s = time.monotonic()
        threading.Thread(target=self._listen, args=(pipe,), daemon=True).start()

    @property
    def silent_s(self) -> float:
        """The time since the last sign."""
        return time.monotonic() - self._last_s

    def _listen(self, pipe: IO[bytes]) -> None:
        with contextlib.suppress(ValueError, OSError):  # closed under its hands, at the end
            for _ in pipe:
                self.heard, self._last_s = True, time.monotonic()
