"""Word of what the service does not take, once a minute for as long as it lasts."""

import logging
from datetime import UTC, datetime

log = logging.getLogger("surefoot.bridge")

_TELL_S = 60.0


class Backlog:
    """Since when posts fail: a thousand that do so each half a minute are one line a minute.

    `waits` and `taken` are what is logged, while it lasts and once it is over.
    """

    def __init__(self, waits: str = "tracks_wait", taken: str = "tracks_taken_again") -> None:
        self._waits, self._taken = waits, taken
        self._since_s: float | None = None
        self._told_s = 0.0

    def tell(self, now_s: float, **of_what: object) -> None:
        """Log what waits and since when, unless that was told within the last minute."""
        if self._since_s is None:
            self._since_s, self._told_s = now_s, now_s - _TELL_S
        if now_s - self._told_s >= _TELL_S:
            self._told_s = now_s
            since = datetime.fromtimestamp(self._since_s, UTC).isoformat(timespec="seconds")
            log.warning(self._waits, extra={"since": since, **of_what})

    def end(self, now_s: float) -> None:
        """Log that all is taken again, where it was not."""
        if self._since_s is not None:
            log.info(self._taken, extra={"after_s": round(now_s - self._since_s)})
            self._since_s = None
