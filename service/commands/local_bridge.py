"""The bridge that `surefoot serve` starts where a broker is named, minds and ends."""

import logging
import subprocess
import threading
from typing import Self

from service.interpreter import command_of
from service.settings import Settings
from service.workers.processes import exits
from service.workers.processes.children import TICK_S, ended, keep_alive

log = logging.getLogger("surefoot.serve")

TOKEN_VARIABLE = "SUREFOOT_TOKEN"
_ANY = {"0.0.0.0": "127.0.0.1", "::": "::1"}


class LocalBridge:
    """A process that ends with this one, by the end of its stdin; one that dies is started anew.

    `serve` goes on without it: its log says that it died, and why.
    """

    def __init__(self, settings: Settings, host: str, port: int, token: str | None) -> None:
        host = _ANY.get(host, host)
        self._url = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
        self._settings = settings
        self._environment = settings.as_environment()
        if token is not None:  # no flag: every user of a machine sees the words of its commands
            self._environment[TOKEN_VARIABLE] = token
        self._stopping = threading.Event()
        parts = (self._run, self._tell, self._stopping)
        self._thread = threading.Thread(target=keep_alive, args=parts, daemon=True)

    def __enter__(self) -> Self:
        if self._settings.mqtt_url is not None:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    def _tell(self, status: int, _: int, rest_s: float) -> bool:
        fields = {"status": status, "why": exits.words_of(status), "again_in_s": rest_s}
        log.error("bridge_ended", extra=fields)
        return True

    def _run(self, _: int) -> int:
        """Run it until it ends or is to end; returns its exit status."""
        with subprocess.Popen(
            command_of("service.cli", "bridge", "--url", self._url, "--follow-stdin"),
            stdin=subprocess.PIPE,
            env=self._environment,
        ) as process:
            while process.poll() is None and not self._stopping.wait(TICK_S):
                pass
            return ended(process)
