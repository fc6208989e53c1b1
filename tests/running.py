"""Real services under test: started, waited for, killed, started again and stopped."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import psutil

from service.settings import Settings
from tests.service.commands.forked import Forked


def wait_for(what: Callable[[], Any], timeout_s: float = 90.0, every_s: float = 0.2) -> Any:
    """The first true answer; fails loudly when none comes."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        answer = what()
        if answer:
            return answer
        time.sleep(every_s)
    raise AssertionError(f"nothing true within {timeout_s} s")


class RunningService:
    """A real `surefoot serve`, which a test may kill and start again over the same data.

    Unless it is said otherwise, it is `forked` off a process that has imported it: each start
    takes a second of computing less.
    """

    def __init__(self, settings: Settings, *, forked: bool = True) -> None:
        self.settings = settings
        self._forked = forked
        self.url = f"http://{settings.host}:{settings.port}"
        self.http = httpx.Client(base_url=self.url, timeout=30)
        self.log = settings.data_dir.parent / "serve.log"
        self.process: Forked | subprocess.Popen[bytes]

    def start(self) -> None:
        environment = self.settings.as_environment()
        if self._forked:
            self.process = Forked(["serve"], environment, self.log, self.log)
        else:
            with self.log.open("a") as log:
                command = [sys.executable, "-m", "service.cli", "serve"]
                self.process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        wait_for(self.answers, every_s=0.02)

    def start_again(self, **changes: Any) -> None:
        """Stop, and start with some settings changed."""
        self.stop()
        self.settings = self.settings.model_copy(update=changes)
        self.http = httpx.Client(base_url=self.url, timeout=30)
        self.start()
        if self.settings.workers:
            wait_for(self.ready)

    def answers(self) -> bool:
        assert self.process.poll() is None, self.log.read_text()
        try:
            return self.http.get("/healthz").status_code == 200
        except httpx.TransportError:
            return False

    def ready(self) -> bool:
        return self.http.get("/readyz").status_code == 200

    def kill(self) -> None:
        """`kill -9` of the API; its workers end by themselves."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)

    def worker_pid(self) -> int:
        """The pid of the local worker."""
        (worker,) = psutil.Process(self.process.pid).children()
        return worker.pid

    def stop(self) -> int:
        if self.process.poll() is None:
            self.process.terminate()
        code = self.process.wait(20)
        self.http.close()
        return code


@contextlib.contextmanager
def served(folder: Path, migrated: Path, **changes: Any) -> Iterator[RunningService]:
    """A server over an empty data directory, as long as the block lasts."""
    shutil.copytree(migrated, folder / "data")
    made = Settings(data_dir=folder / "data", workers=0, port=free_port(), **changes)
    running = RunningService(made)
    running.start()
    try:
        yield running
    finally:
        running.stop()


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def pid_exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
