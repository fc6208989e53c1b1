"""The workers that `surefoot serve` starts, minds and ends."""

import contextlib
import logging
import subprocess
import sys
import threading
from collections.abc import Iterator

from service.settings import Settings

log = logging.getLogger("surefoot.serve")

_WORKER_STOP_S = 10.0


@contextlib.contextmanager
def local_workers(settings: Settings) -> Iterator[None]:
    """Run the local workers as long as the block lasts."""
    workers = LocalWorkers(settings)
    workers.start()
    try:
        yield
    finally:
        workers.stop()


class LocalWorkers:
    """Worker processes that live and die with this one; one that dies is started again.

    Each reads its stdin, whose other end is ours: when this process ends in whatever way, even by
    `kill -9`, the workers end too.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._keep, args=(f"local-{number}",), daemon=True)
            for number in range(settings.workers)
        ]

    def start(self) -> None:
        """Start them all."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Ask them to end, and wait."""
        self._stopping.set()
        for thread in self._threads:
            thread.join()

    def _keep(self, name: str) -> None:
        while not self._stopping.is_set():
            process = subprocess.Popen(
                [sys.executable, "-m", "service.cli", "worker", "--name", name, "--follow-stdin"],
                stdin=subprocess.PIPE,
                env=self._settings.as_environment(),
            )
            while process.poll() is None and not self._stopping.wait(0.2):
                pass
            if self._stopping.is_set():
                process.terminate()
                try:
                    process.wait(_WORKER_STOP_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
            else:
                log.warning("worker_died", extra={"worker": name, "status": process.returncode})
                self._stopping.wait(1.0)
