"""The bridge that `surefoot serve` starts if a broker is configured, restarts and ends."""

import logging
import subprocess
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Self

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.errors import OverloadedError
from service.interpreter import command_of
from service.operations import bridges
from service.settings import Settings
from service.store.engines.store import Store
from service.workers.processes import exits
from service.workers.processes.children import SETTLED_S, TICK_S, ended, keep_alive
from surefoot.bridge.heartbeat import bridge_name

log = logging.getLogger("surefoot.serve")

_REPORTED_FROM = 3  # deaths in a row
TOKEN_VARIABLE = "SUREFOOT_TOKEN"
_ANY = {"0.0.0.0": "127.0.0.1", "::": "::1"}


class LocalBridge:
    """A process that ends with this one, by the end of its stdin; one that dies is started anew.

    `serve` goes on without it. After three ends in a row `/readyz` and the health page say why.
    """

    def __init__(self, settings: Settings, host: str, port: int, token: str | None) -> None:
        host = _ANY.get(host, host)
        self._url = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
        self._settings = settings
        self._name = bridge_name(settings.mqtt_client_id)
        self._store = Store(settings)
        self._environment = settings.as_environment()
        if token is not None:  # no flag: every user of a machine sees the words of its commands
            self._environment[TOKEN_VARIABLE] = token
        self._stopping = threading.Event()
        parts = (self._run, self._tell, self._stopping)
        self._thread = threading.Thread(target=keep_alive, args=parts, daemon=True)

    def __enter__(self) -> Self:
        # No heartbeat of an earlier one is expected, until this one has sent its first.
        self._note(partial(bridges.note_stopped, name=self._name))
        if self._settings.mqtt_url is not None:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self._store.close()

    def _tell(self, status: int, deaths: int, rest_s: float) -> bool:
        words = exits.words_of(status)
        fields = {"status": status, "why": words, "again_in_s": rest_s}
        log.error("bridge_ended", extra=fields)
        if deaths >= _REPORTED_FROM:
            trouble = f"it ended {deaths} times in a row, the last time: {words}"
            self._note(partial(bridges.note_trouble, name=self._name, trouble=trouble))
        return True

    def _run(self, deaths: int) -> int:
        """Run it until it ends or is to end; returns its exit status."""
        reported = deaths >= _REPORTED_FROM
        begun_s = time.monotonic()
        with subprocess.Popen(
            command_of("service.cli", "bridge", "--url", self._url, "--follow-stdin"),
            stdin=subprocess.PIPE,
            env=self._environment,
        ) as process:
            while process.poll() is None and not self._stopping.wait(TICK_S):
                if reported and time.monotonic() - begun_s > SETTLED_S:
                    self._note(partial(bridges.note_trouble, name=self._name, trouble=None))
                    reported = False
            return ended(process)

    def _note(self, change: Callable[[Session], None]) -> None:
        try:
            with self._store.write(bridges.ABOUT) as session:
                change(session)
        except (SQLAlchemyError, OverloadedError) as error:
            log.warning("trouble_not_noted", extra={"bridge": self._name, "why": str(error)})
