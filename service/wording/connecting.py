"""What comes for a camera that learns, in words; and what mends what is refused."""

from models.durations import HOUR_S
from service.wording.language import N_, _, _n, number
from service.wording.times import duration
from surefoot.people import SkipReason

_SOON_S = 60.0  # after a track's end: portions and networks take as long
_ZONES_H, _NEAR_ZONE_S = 14, 120.0

_MENDS = {
    "too_short": N_(
        "The tracker loses people, or posts them in pieces: let it keep who is hidden for 2 s or "
        "more (track_buffer of ByteTrack, max_age of DeepSORT), and post each track once, when it "
        "has ended."
    ),
    "time_out_of_range": N_(
        "The clock or the zone where the tracks are made is wrong (set it by NTP), or the times "
        "are milliseconds: seconds since 1970 are needed."
    ),
    "time_not_increasing": N_("Points go in the order of their times, each time once."),
    "outside_image": N_(
        "The numbers are of another picture than the camera was registered with: of a smaller "
        "stream, or from 0 to 1."
    ),
    "outside_lens": N_(
        "The numbers are of another picture than the fisheye was calibrated with, or of its black "
        "border; a dewarped stream is a camera of its own."
    ),
    "gap": N_("The tracker gives a name to somebody else: end a track that is not seen any more."),
    "too_long": N_("The frame rate is wrong, or a track is of several people."),
    "unsupported_media_type": N_(
        "Set the Content-Type header to the form of the body: application/json, "
        "application/x-ndjson or text/csv."
    ),
}

_SKIPPED = {
    SkipReason.NOT_A_PERSON: (
        N_("{n} track skipped: not a person"),
        N_("{n} tracks skipped: not a person"),
    ),
    SkipReason.CONFIDENCE: (
        N_("{n} track skipped: confidence 0"),
        N_("{n} tracks skipped: confidence 0"),
    ),
    SkipReason.NO_ID: (
        N_("{n} track skipped: no track id"),
        N_("{n} tracks skipped: no track id"),
    ),
}


def skipped_words(reason: SkipReason, count: int) -> str:
    """Return how many tracks were skipped for a reason."""
    one, many = _SKIPPED[reason]
    return _(one if count == 1 else many, n=count)


def fix_words(code: str) -> str:
    """What mends a refusal; empty where its own words say all."""
    return _(_MENDS.get(code, ""))


def delay_words(least_s: float, median_s: float) -> str:
    """What the times between tracks' ends and their arrivals tell of the two clocks."""
    if least_s < -1.0:
        return _(
            "Tracks end up to {time} after they come: the clock that they are made by is ahead of "
            "this service's. Set both by NTP.",
            time=duration(-least_s),
        )
    if median_s <= _SOON_S:
        return _("Tracks come {time} after their end: the clocks agree.", time=_brief(median_s))
    hours = round(median_s / HOUR_S)
    if 1 <= hours <= _ZONES_H and abs(median_s - hours * HOUR_S) <= _NEAR_ZONE_S:
        return _(
            "Tracks come {time} after their end: whole hours look like a wrong time zone, unless "
            "they are of a recording.",
            time=duration(median_s),
        )
    return _(
        "Tracks come {time} after their end: of a recording that is so; else the clock that they "
        "are made by is behind.",
        time=duration(median_s),
    )


def rate_words(rate_hz: float | None) -> str:
    """How many tracks come a minute."""
    if rate_hz is None:
        return _("none in the last 10 minutes")
    a_minute = 60 * rate_hz
    rate = number(a_minute, ".0f" if a_minute >= 10 else ".1f")
    return _("{rate} tracks a minute", rate=rate)


def ready_words(counted: int, wanted: int, ready_in_s: float | None) -> str:
    """When a reference is ready, as far as is known."""
    if counted >= wanted:
        return _("everybody is there: it is learned at the next look")
    if ready_in_s is None:
        return _n("{n} person is missing", "{n} people are missing", wanted - counted)
    return _("ready in about {time} at this rate", time=duration(max(ready_in_s, 1.0)))


def age_words(seconds: float) -> str:
    """An age, to the second where that tells whether a connection lives."""
    time = f"{max(seconds, 0):.0f} s" if seconds < 90 else duration(seconds)
    return _("{time} ago", time=time)


def _brief(seconds: float) -> str:
    return f"{number(max(seconds, 0.0), '.1f')} s" if seconds < 10 else f"{seconds:.0f} s"
