"""Hosts of cameras that did not answer: for a while they are not asked again."""

import threading
import time

from service.addresses import origin_of

_FIRST_S = 2.0


class HostBackoff:
    """Pauses by host, which double with each failure in a row.

    A recorder that is switched off thus costs one connection in each pause, however many cameras
    have their images there.

    Args:
        longest_s: the longest pause of a host.
    """

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._pauses: dict[str, tuple[float, float]] = {}  # by host: until when, how long
        self._lock = threading.Lock()

    def left_s(self, url: str) -> float:
        """Seconds until the host of a URL may be asked again; 0 if it may be asked now."""
        until_s, _ = self._pauses.get(origin_of(url), (0.0, 0.0))
        return max(until_s - time.monotonic(), 0.0)

    def failed(self, url: str) -> None:
        """Note that the host of a URL did not answer."""
        origin, now_s = origin_of(url), time.monotonic()
        with self._lock:
            until_s, pause_s = self._pauses.get(origin, (0.0, 0.0))
            if now_s < until_s:
                return  # requests that began before the pause are one failure together
            pause_s = min(max(2 * pause_s, _FIRST_S), self._longest_s)
            self._pauses[origin] = now_s + pause_s, pause_s

    def answered(self, url: str) -> None:
        """Note that the host of a URL answered: its next failure is the first one."""
        with self._lock:
            self._pauses.pop(origin_of(url), None)
