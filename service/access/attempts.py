"""Counts failing credentials by address, so that who guesses is told to wait."""

import threading
import time
from collections import OrderedDict
from dataclasses import dataclass
from ipaddress import ip_address, ip_network

MOST = 10
WITHIN_S = 60.0
_MOST_ADDRESSES = 10_000
_MOST_LINES = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """The consequences of a failure: seconds to wait (0: none), and whether to write it down."""

    wait_s: int
    worth_a_line: bool


class Attempts:
    """Failures of the last minute by address; of the addresses, the newest so many."""

    def __init__(self) -> None:
        self._failures: OrderedDict[str, list[float]] = OrderedDict()
        self._lines: list[float] = []
        self._lock = threading.Lock()

    def failed(self, address: str) -> Failure:
        """Note a failure.

        The first of an address within a minute is worth a line of the log, as long as these are
        not so many themselves that they would fill it.
        """
        now = time.monotonic()
        key = _network(address)
        with self._lock:
            recent = _recent(self._failures.pop(key, []), now)
            over = len(recent) >= MOST
            first = not recent
            if not over:
                recent.append(now)
            self._failures[key] = recent
            while len(self._failures) > _MOST_ADDRESSES:
                self._failures.popitem(last=False)
            self._lines = _recent(self._lines, now)
            worth_a_line = first and len(self._lines) < _MOST_LINES
            if worth_a_line:
                self._lines.append(now)
        return Failure(
            wait_s=int(recent[0] + WITHIN_S - now) + 1 if over else 0, worth_a_line=worth_a_line
        )


def _recent(times: list[float], now: float) -> list[float]:
    return [at for at in times if at > now - WITHIN_S]


def _network(address: str) -> str:
    """An address as far as one guesser has no other: of IPv6, the network."""
    try:
        found = ip_address(address)
    except ValueError:
        return address
    return str(ip_network((found, 64), strict=False)) if found.version == 6 else address
