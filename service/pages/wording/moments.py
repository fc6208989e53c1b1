"""Times in words, by the cameras' own clock."""

from datetime import datetime, timedelta, tzinfo


def when(at: datetime, now: datetime, zone: tzinfo) -> str:
    """A time as one would say it: "14:32", "14:32 yesterday", "14:32 on Monday", "3 Mar, 14:32"."""
    local, today = at.astimezone(zone), now.astimezone(zone).date()
    clock = f"{local:%H:%M}"
    days = (today - local.date()).days
    if days == 0:
        return clock
    if days == 1:
        return f"{clock} yesterday"
    if days == -1:
        return f"{clock} tomorrow"
    if 1 < days < 7:
        return f"{clock} on {local:%A}"
    year = "" if local.year == today.year else f" {local.year}"
    return f"{local.day} {local:%b}{year}, {clock}"


def next_morning(now: datetime, zone: tzinfo) -> datetime:
    """Eight o'clock of tomorrow, by the cameras' clock."""
    local = now.astimezone(zone) + timedelta(days=1)
    return local.replace(hour=8, minute=0, second=0, microsecond=0)
