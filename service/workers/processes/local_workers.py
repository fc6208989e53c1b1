"""The workers that `surefoot serve` starts, minds and ends."""

import contextlib
import logging
import subprocess
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import IO, Self

from sqlalchemy.exc import SQLAlchemyError

from service.errors import ServiceError
from service.interpreter import command_of
from service.settings import Settings
from service.store.engines.store import Store
from service.workers.processes import exits
from service.workers.processes.children import SETTLED_S, TICK_S, ended, keep_alive
from service.workers.processes.workers import WORKERS, note_trouble, worker_name

log = logging.getLogger("surefoot.serve")

_START_S = 120.0  # until its first sign of life: on a busy machine its imports take a while
_REPORTED_FROM = 3  # deaths in a row


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
        self._say(name, None)
        keep_alive(partial(self._run, name), partial(self._tell, name), self._stopping)

    def _tell(self, name: str, status: int, deaths: int, rest_s: float) -> bool:
        words = exits.words_of(status)
        if status == exits.REFUSED:
            log.error("worker_refused", extra={"worker": name, "why": words})
            self.refused = True
            self._give_up()
            return False
        fields = {"worker": name, "status": status, "why": words, "again_in_s": rest_s}
        log.warning("worker_ended", extra=fields)
        if deaths >= _REPORTED_FROM:
            self._say(name, f"died {deaths} times in a row: {words}; started every {rest_s:g} s")
        return True

    def _run(self, name: str, deaths: int) -> int:
        """Run a worker until it ends, hangs or is to end; returns its exit status."""
        reported = deaths >= _REPORTED_FROM
        with subprocess.Popen(
            command_of("service.cli", "worker", "--name", name, "--follow-stdin"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=self._settings.as_environment(),
        ) as process:
            beats = _Heartbeat(process.stdout)
            begun_s = time.monotonic()
            while process.poll() is None and not self._stopping.wait(TICK_S):
                limit_s = self._settings.worker_lost_s if beats.heard else _START_S
                if beats.silent_s > limit_s:
                    fields = {"worker": name, "pid": process.pid, "silent_s": limit_s}
                    log.error("worker_hangs", extra=fields)
                    process.kill()
                    process.wait()
                if reported and time.monotonic() - begun_s > SETTLED_S:
                    self._say(name, None)
                    reported = False
            return ended(process)

    def _say(self, name: str, trouble: str | None) -> None:
        """Have `/readyz` say what is wrong with a worker, or nothing."""
        try:
            with self._store.write(WORKERS) as session:
                note_trouble(session, name, trouble)
        except (SQLAlchemyError, ServiceError) as error:
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
