"""The service under test: a real `surefoot serve`, started again when it ends, as systemd would."""

import ctypes
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import psutil

from service.settings import Settings
from tests.faults.clock import Clock
from tests.running import free_port

_RESTART_S = 0.3
_LIBC = ctypes.CDLL(None)
_DEATH_SIGNAL = 1  # prctl's PR_SET_PDEATHSIG


def _dies_with_us() -> None:
    """Run in the child before its program: it takes no lock and imports nothing."""
    _LIBC.prctl(_DEATH_SIGNAL, signal.SIGKILL)


class Stand:
    """A data directory, `serve` over it, and a supervisor that keeps it running."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder, self.log = folder, folder / "serve.log"
        self.disk = folder / "disk"  # a small file system of its own, where that is possible
        self.disk.mkdir()
        self.settings = Settings(
            data_dir=self.disk / "data",
            port=free_port(),
            workers=workers,
            epochs=1,
            reconcile_s=1,
            worker_lost_s=6,
            webhook_allow="127.0.0.0/8",
            webhook_retry_s="1",
        )
        self.url = f"http://{self.settings.host}:{self.settings.port}"
        self.process: subprocess.Popen[bytes] | None = None
        self.starts = self._ends = 0
        self._wanted, self._over = threading.Event(), threading.Event()
        self._environment = self.settings.as_environment() | self._extras()
        self._keeper = threading.Thread(target=self._keep)
        self._keeper.start()

    def _extras(self) -> dict[str, str]:
        here = Path(__file__).parent
        site = self.folder / "site"
        site.mkdir()
        shutil.copy(here / "witness.py", site / "sitecustomize.py")
        (self.folder / "witness").mkdir()
        path = os.pathsep.join(filter(None, (str(site), os.environ.get("PYTHONPATH"))))
        extras = {"PYTHONPATH": path, "FAULTS_WITNESS": str(self.folder / "witness")}
        self._clock, self.ahead_s = Clock(self.folder), 0
        self.has_clock = self._clock.environment is not None
        return extras | (self._clock.environment or {})

    def set_clock(self, ahead_s: int) -> None:
        """Have the service's wall clock run so many seconds ahead."""
        self._clock.set(ahead_s)
        self.ahead_s = ahead_s

    def now_s(self) -> float:
        """The wall clock that the service and its cameras live by."""
        return time.time() + self.ahead_s

    def command(self, **changes: str) -> subprocess.Popen[bytes]:
        """Another `serve` over other data; the caller ends it."""
        return subprocess.Popen(
            [sys.executable, "-m", "service.cli", "serve"],
            env=self._environment | changes,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            preexec_fn=_dies_with_us,  # noqa: PLW1509
        )

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
                self.process = subprocess.Popen(
                    [sys.executable, "-m", "service.cli", "serve"],
                    env=self._environment,
                    stdout=log,
                    stderr=log,
                    preexec_fn=_dies_with_us,  # noqa: PLW1509
                )
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
        """Processes of this run that still live: by their environment's data directory."""
        found = []
        for process in psutil.process_iter():
            try:
                if process.pid != os.getpid() and process.environ().get("FAULTS_WITNESS") == str(
                    self.folder / "witness"
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
