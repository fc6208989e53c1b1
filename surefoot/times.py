"""Times of tracks: seconds since the Unix epoch, RFC 3339, and values that are neither."""

import re

LAST_S = 253_402_300_799.0  # the end of the year 9999
_LOST_PLUS = re.compile(r"(T\d\d[:\d.]*) (\d\d:?\d\d)$")


def not_seconds(value: float) -> str:
    """Return the message about a time after the year 9999, for every source of tracks."""
    unit = "milliseconds" if value < 1e15 else "micro- or nanoseconds"
    return f"must be seconds since 1970; the value looks like {unit}, got {value:.3f}"


def restore_plus(text: str) -> str:
    """Return an RFC 3339 time with the `+` of its zone, which a query turns into a blank.

    A blank between the time and hours and minutes can be nothing else.
    """
    return _LOST_PLUS.sub(r"\1+\2", text)
