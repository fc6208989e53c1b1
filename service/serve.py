"""`surefoot serve`: the API and its local workers, one command."""

import contextlib
import logging
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator

import uvicorn

from service.app import create_app
from service.migrate import migrate
from service.settings import Settings

log = logging.getLogger("surefoot.serve")

_WORKER_STOP_S = 10.0


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


def run_service(settings: Settings) -> None:
    """Migrate, start the workers, serve until SIGTERM or SIGINT, stop cleanly."""
    with contextlib.closing(_listen(settings)) as listener:
        migrate(settings)
        config = uvicorn.Config(
            create_app(settings),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=3,
        )
        server = uvicorn.Server(config)
        with _workers(settings):
            host, port = listener.getsockname()[:2]
            log.info("serving", extra={"url": f"http://{host}:{port}"})
            # uvicorn raises the signal that ended it once more; by then there is nothing to kill.
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, lambda *_: None)
            server.run(sockets=[listener])
    log.info("stopped")


@contextlib.contextmanager
def _workers(settings: Settings) -> Iterator[None]:
    workers = LocalWorkers(settings)
    workers.start()
    try:
        yield
    finally:
        workers.stop()


def _listen(settings: Settings) -> socket.socket:
    """The listening socket; taken first, so that a port in use fails before anything starts."""
    listener = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind((settings.host, settings.port))
    return listener
