"""The bridge's sign of life to the service, with its counts; and its end, if a message hangs."""

import logging
import os
import re
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from surefoot.bridge.backlog import Backlog
from surefoot.bridge.service import LaterError, RefusedError, Service

log = logging.getLogger("surefoot.bridge")

BEAT_S = 10.0
HANGS_S = 120.0  # no step takes so long, unless a message or the disk hangs
_HANGS = 70  # exit status
_OTHERS = re.compile(r"[^A-Za-z0-9._-]")


def bridge_name(client_id: str) -> str:
    """The name of a bridge at the service, by its client id at the broker."""
    return _OTHERS.sub("-", client_id)[:63]


@dataclass(kw_only=True)
class Heartbeat:
    """What is sent about a bridge of a name; `report` is asked for its counts each time.

    `step_s` is how long the step under way has taken.
    """

    name: str
    report: Callable[[], dict[str, Any]]
    step_s: Callable[[], float]
    end: Callable[[int], object] = os._exit
    _backlog: Backlog = field(default_factory=lambda: Backlog("heartbeat_waits", "heartbeat_again"))

    def run(self, service: Service, stopping: threading.Event) -> None:
        """Report at intervals until the event is set, and once more then."""
        while not stopping.is_set():
            self._beat(service, stopped=False)
            step_s = self.step_s()
            if step_s > HANGS_S:
                # Its thread cannot be ended otherwise; the message counts as one that crashed.
                log.error("bridge_hangs", extra={"step_s": round(step_s)})
                logging.shutdown()
                self.end(_HANGS)
            stopping.wait(BEAT_S)
        self._beat(service, stopped=True)

    def _beat(self, service: Service, *, stopped: bool) -> None:
        try:
            service.put(f"/bridges/{self.name}", self.report() | {"stopped": stopped})
            self._backlog.end(time.time())
        except (LaterError, RefusedError) as error:
            if not stopped:
                self._backlog.tell(time.time(), reason=str(error))
