"""Times, ages and durations in words."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo

from babel.dates import format_timedelta, get_day_names, get_month_names

from service.wording.language import _, spoken

_AT_LEAST = 1.5  # of a unit, to say a length of time in it: "90 minutes", then "2 hours"
_JUST_NOW = timedelta(seconds=30), timedelta(minutes=1)  # before and after now


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Now, by the cameras' own clock: what templates say times with."""

    now: datetime
    zone: tzinfo

    def when(self, at: datetime) -> str:
        """A time as one would say it: "14:32", "14:32 yesterday", "14:32 on Monday", "3 Mar"."""
        local, today = at.astimezone(self.zone), self.now.astimezone(self.zone).date()
        clock = f"{local:%H:%M}"
        days = (today - local.date()).days
        if days == 0:
            return clock
        if days == 1:
            return _("{time} yesterday", time=clock)
        if days == -1:
            return _("{time} tomorrow", time=clock)
        if 1 < days < 7:
            day = get_day_names("wide", locale=spoken())[local.weekday()]
            return _("{time} on {day}", time=clock, day=day)
        year = "" if local.year == today.year else f" {local.year}"
        return f"{day_and_month(local)}{year}, {clock}"

    def in_full(self, at: datetime) -> str:
        """A time with its date and zone."""
        return f"{at.astimezone(self.zone):%Y-%m-%d %H:%M %Z}"

    def dated(self, at: datetime) -> str:
        """A time with its day, that is read weeks later: "Mon 23 Nov, 14:32"."""
        local = at.astimezone(self.zone)
        day = get_day_names("abbreviated", locale=spoken())[local.weekday()]
        return f"{day} {day_and_month(local)}, {local:%H:%M}"

    def day(self, at: datetime) -> str:
        """A day: "23 Nov 2026"."""
        local = at.astimezone(self.zone)
        return f"{day_and_month(local)} {local.year}"

    def iso_day(self, at: datetime) -> str:
        """The same as addresses and forms have it."""
        return f"{at.astimezone(self.zone):%Y-%m-%d}"

    def ago(self, at: datetime) -> str:
        """An age in minutes or more, or in how long a time comes; `times.js` keeps it true.

        Seconds would change under whoever reads, and nobody acts on them.
        """
        if self.now - _JUST_NOW[0] < at <= self.now + _JUST_NOW[1]:
            return _("just now")
        # A whole number, since of a timedelta it would take the second before.
        seconds = round((at - self.now).total_seconds())
        return format_timedelta(
            seconds, "minute", threshold=_AT_LEAST, add_direction=True, locale=spoken()
        )

    def of(self, seconds: float) -> datetime:
        """The time of seconds since the epoch."""
        return from_seconds(seconds)


def day_and_month(local: datetime) -> str:
    """A day: "23 Nov"."""
    month = get_month_names("abbreviated", locale=spoken())[local.month]
    return _("{day} {month}", day=local.day, month=month)


def duration(seconds: float) -> str:
    """A length of time, roughly: "40 seconds", "12 minutes", "3 hours", "4 days"."""
    return format_timedelta(round(max(seconds, 0.0)), threshold=_AT_LEAST, locale=spoken())


def from_seconds(at_s: float) -> datetime:
    """The time of seconds since the epoch, as tracks have it."""
    return datetime.fromtimestamp(at_s, UTC)
