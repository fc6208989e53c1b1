"""Times in the store that something waits for, on a clock that may be set back or forward."""

from datetime import datetime, timedelta


def lies_ahead(at: datetime | None, now: datetime, longest_s: float) -> bool:
    """Whether a time is still to come that was set at most so many seconds ahead.

    One that lies further ahead was set before the clock was set back: waiting for it would take
    as long as the clock jumped, so it counts as come.
    """
    return at is not None and timedelta(0) < at - now <= timedelta(seconds=longest_s)
