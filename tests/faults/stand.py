"""What is under test: one machine over a file, or several over a PostgreSQL server."""

import base64
import os
import shutil
import subprocess
import time
from itertools import chain
from pathlib import Path

import psutil

from service.commands.migrate import migrate
from service.settings import Settings
from tests.faults.clock import Clock
from tests.faults.database import Database
from tests.faults.machine import Machine, serve
from tests.running import free_port


class Stand:
    """Machines, each with a data directory of its own, and the database that they share.

    Without a database there is one machine, and its store is a file; the disk that it lies on may
    be a small file system of its own.
    """

    def __init__(self, folder: Path, workers: int, machines: int, *, on_server: bool) -> None:
        self.folder, self.disk = folder, folder / "disk"
        self.disk.mkdir()
        self.database = Database(folder, machines) if on_server else None
        # One for all, as machines that share a database must have; a file of its own otherwise.
        self._key = base64.b64encode(os.urandom(32)).decode() if on_server else None
        extras = self._extras()
        self.machines = [
            Machine(
                self._settings(number, workers),
                folder / (f"serve-{number}.log" if number else "serve.log"),
                extras,
            )
            for number in range(machines)
        ]
        self.settings, self.log = self.machines[0].settings, self.machines[0].log
        if self.database is not None:
            # Not through the first machine's link: what looks at the store is cut off by nothing.
            direct = {"database_url": self.database.url}
            self.settings = self.settings.model_copy(update=direct)

    def _settings(self, number: int, workers: int) -> Settings:
        return Settings(
            data_dir=self.disk / (f"data-{number}" if number else "data"),
            database_url=None if self.database is None else self.database.links[number].url,
            secret_key=self._key,
            port=free_port(),
            workers=workers,
            epochs=1,
            reconcile_s=1,
            worker_lost_s=6,
            webhook_allow="127.0.0.0/8",
            webhook_retry_s="1",
        )

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

    def prepare(self) -> None:
        """Make the data directories; on a server, which nobody migrates by himself, its schema."""
        for machine in self.machines:
            machine.settings.data_dir.mkdir()
        if self.database is not None:
            migrate(self.settings)

    @property
    def starts(self) -> int:
        """How often a service was started."""
        return sum(machine.starts for machine in self.machines)

    def set_clock(self, ahead_s: int) -> None:
        """Have the service's wall clock run so many seconds ahead."""
        self._clock.set(ahead_s)
        self.ahead_s = ahead_s

    def now_s(self) -> float:
        """The wall clock that the service and its cameras live by."""
        return time.time() + self.ahead_s

    def command(self, **changes: str) -> subprocess.Popen[bytes]:
        """Another `serve` over other data; the caller ends it."""
        return serve(self.machines[0].environment | changes, subprocess.PIPE)

    def start(self) -> None:
        """Keep all running from now on."""
        for machine in self.machines:
            machine.start()

    def refused(self) -> int:
        """How often services have ended since they were to be kept running."""
        return sum(machine.refused() for machine in self.machines)

    def stop(self, *, kill: bool = False) -> None:
        """End all, and leave them so until they are started again."""
        for machine in self.machines:
            machine.stop(kill=kill)

    def close(self) -> None:
        """End everything."""
        for machine in self.machines:
            machine.close()
        if self.database is not None:
            self.database.close()

    def workers(self) -> list[psutil.Process]:
        """The worker processes of all services."""
        return list(chain.from_iterable(machine.workers() for machine in self.machines))

    def answers(self, path: str = "/healthz") -> bool:
        """Whether every machine answers a path with 200."""
        return all(machine.answers(path) for machine in self.machines)
