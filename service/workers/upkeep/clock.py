"""The clock set back: what waits for a time waits no longer for it."""

import logging
import time
from datetime import timedelta

from sqlalchemy.orm import Session

from service.notifications import deliveries
from service.workers.context import JobContext
from service.workers.processes.workers import take_setback

log = logging.getLogger("surefoot.jobs")
_JUMP_S = 2.0


class ClockWatch:
    """Compares the clock with the monotonic one, that nobody sets."""

    def __init__(self) -> None:
        self._ahead_s = time.time() - time.monotonic()

    def look(self, context: JobContext) -> None:
        """Follow the clock, where it was set back since the last look."""
        ahead_s = time.time() - time.monotonic()
        back_s = self._ahead_s - ahead_s
        if back_s >= _JUMP_S:
            with context.store.write() as session:
                _follow(session, timedelta(seconds=back_s))
        self._ahead_s = ahead_s  # not before: where nothing could be written, it is seen again


def follow_clock_since_last_run(context: JobContext) -> None:
    """The same of a clock that was set back while no worker watched; before a worker registers."""
    with context.store.write() as session:
        back = take_setback(session)
        if back.total_seconds() >= _JUMP_S:
            _follow(session, back)


def _follow(session: Session, back: timedelta) -> None:
    moved = deliveries.follow_clock(session, back)
    log.warning("clock_set_back", extra={"by_s": round(back.total_seconds()), "deliveries": moved})
