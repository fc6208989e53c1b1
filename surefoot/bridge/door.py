"""Which cameras the service has: messages for others are dropped before they are kept."""

import logging
import threading
import time
from collections.abc import Callable

from surefoot.bridge.service import LaterError, RefusedError, Service

log = logging.getLogger("surefoot.bridge")

LIFETIME_S = 10.0  # of the list; an event about an unknown camera ends it sooner


class Door:
    """The service's list of cameras, asked for when a name is not in it; for several threads.

    While the service does not answer, every camera is admitted: the spool keeps its tracks.
    """

    def __init__(self, service: Service, clock: Callable[[], float] = time.monotonic) -> None:
        self._service, self._clock = service, clock
        self._lock = threading.Lock()
        self._known: frozenset[str] = frozenset()
        self._asked_s: float | None = None
        self._answered = False

    def admits(self, camera: str) -> bool:
        """Return whether the service has a camera, or may have it."""
        with self._lock:
            if camera in self._known:
                return True
            now_s = self._clock()
            if self._asked_s is None or now_s - self._asked_s >= LIFETIME_S:
                self._ask(now_s)
            return not self._answered or camera in self._known

    def expect(self, camera: str) -> None:
        """Ask again for the next unknown name: an event is about a camera that is not known."""
        with self._lock:
            if camera not in self._known:
                self._asked_s = None

    def cameras(self) -> frozenset[str] | None:
        """The cameras that the service has now; None if it does not answer."""
        with self._lock:
            self._ask(self._clock())
            return self._known if self._answered else None

    def _ask(self, now_s: float) -> None:
        self._asked_s = now_s
        try:
            self._known = frozenset(each["id"] for each in self._service.items("/cameras"))
            self._answered = True
        except (LaterError, RefusedError) as error:
            self._answered = False
            log.warning("cameras_wait", extra={"reason": str(error)})
