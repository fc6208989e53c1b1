"""Times of tracks: seconds since the Unix epoch, and what is not."""

LAST_S = 253_402_300_799.0  # the end of the year 9999


def not_seconds(value: float) -> str:
    """Return the message about a time after the year 9999, for every source of tracks."""
    return (
        f"must be seconds since 1970; the value looks like milliseconds, got {value:.3f}"
        if value < 1e15
        else f"must be seconds since 1970; the value looks like micro- or nanoseconds, "
        f"got {value:.3f}"
    )
