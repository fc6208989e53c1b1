"""A machine under test: a real `surefoot serve`, started again when it ends, as systemd would."""

import ctypes
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import httpx
import psutil

from service.settings import Settings

_RESTART_S = 0.3
_LIBC = ctypes.CDLL(None)
_DEATH_SIGNAL = 1  # prctl's PR_SET_PDEATHSIG


def _dies_with_us() -> None:
    """Run in the child before its program: it takes no lock and imports nothing."""
    _LIBC.prctl(_DEATH_SIGNAL, signal.SIGKILL)


def serve(environment: Mapping[str, str], output: IO[bytes] | int) -> subprocess.Popen[bytes]:
    """A `surefoot serve` that ends with this process; all that it prints goes to an output."""
    return subprocess.Popen(
        [sys.executable, "-m", "service.cli", "serve"],
        env=environment,
        stdout=output,
        stderr=subprocess.STDOUT,
        preexec_fn=_dies_with_us,  # noqa: PLW1509
    )


class Machine:
    """A data directory, `serve` with its workers over it, and a supervisor that keeps it running.

    Args:
        settings: of the service.
        log: what it prints goes here.
        extras: variables of its processes, beside those of the settings.
    """

    def __init__(self, settings: Settings, log: Path, extras: Mapping[str, str]) -> None:
        self.settings, self.log = settings, log
        self.url = f"http://{settings.host}:{settings.port}"
        self.environment = settings.as_environment() | extras
        self.process: subprocess.Popen[bytes] | None = None
        self.starts = self._ends = 0
        self._wanted, self._over = threading.Event(), threading.Event()
        self._keeper = threading.Thread(target=self._keep)
        self._keeper.start()

    def start(self) -> None:
        """Keep it running from now on."""
        self._ends = 0
        self._wanted.set()

    def refused(self) -> int:
        """How often it has ended since it was to be kept running."""
        return self._ends

    def stop(self, *, kill: bool = False) -> None:
        """End it, and leave it so until it is started again."""
        self._wanted.clear()
        process = self.process
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGKILL if kill else signal.SIGTERM)
            process.wait(30)
        end = time.monotonic() + 20
        while self._leftovers() and time.monotonic() < end:
            time.sleep(0.1)
        for worker in self._leftovers():
            worker.kill()

    def close(self) -> None:
        """End everything."""
        self.stop()
        self._over.set()
        self._wanted.set()
        self._keeper.join()

    def _keep(self) -> None:
        while not self._over.is_set():
            self._wanted.wait()
            if self._over.is_set():
                return
            with self.log.open("ab") as log:
                self.process = serve(self.environment, log)
            self.starts += 1
            self.process.wait()
            self._ends += 1
            time.sleep(_RESTART_S)

    def workers(self) -> list[psutil.Process]:
        """The worker processes of the running service."""
        try:
            parent = psutil.Process(self.process.pid if self.process else -1)
            return [child for child in parent.children() if "worker" in child.cmdline()]
        except (psutil.Error, ValueError):
            return []

    def _leftovers(self) -> list[psutil.Process]:
        """Processes that still live: by their environment's data directory."""
        ours, found = self.environment["SUREFOOT_DATA_DIR"], []
        for process in psutil.process_iter():
            try:
                if (
                    process.pid != os.getpid()
                    and process.environ().get("SUREFOOT_DATA_DIR") == ours
                ):
                    found.append(process)
            except psutil.Error:
                continue
        return found

    def kill_api(self) -> bool:
        """`kill -9` of the API; False where none runs."""
        process = self.process
        if process is None or process.poll() is not None:
            return False
        process.kill()
        return True

    def kill_worker(self, random_: random.Random) -> bool:
        """`kill -9` of one worker; False where none runs."""
        workers = self.workers()
        if not workers:
            return False
        try:
            random_.choice(workers).kill()
        except psutil.NoSuchProcess:
            return False
        return True

    def answers(self, path: str = "/healthz") -> bool:
        """Whether a path is answered with 200."""
        try:
            return httpx.get(self.url + path, timeout=5).status_code == 200
        except httpx.HTTPError:
            return False
