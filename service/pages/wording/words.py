"""What is known of a camera in plain words, for who watches hundreds of them."""

import math
from datetime import UTC, datetime, timedelta, tzinfo

from babel.dates import format_timedelta

from models.geometry.plane_parameters import ANGLES
from models.monitoring.verdict import Drift
from service.enums import AlertKind, PoseState
from service.pages.views.fleet import FleetCamera

STATES = {
    PoseState.DRIFTING: "Moved",
    PoseState.NO_DATA: "No people",
    PoseState.LEARNING: "Learning",
    PoseState.OK: "Steady",
}
_AT_LEAST = 1.5  # of a unit, to say a length of time in it: "90 minutes", then "2 hours"
_JUST_NOW = timedelta(seconds=10), timedelta(minutes=1)  # before and after now
# Operators say pan. Height is told apart.
NAMES = {"heading": "pan", "tilt": "tilt", "roll": "roll", "height": "height"}


def situation(camera: FleetCamera, now: datetime) -> str:
    """What a camera does, in one line."""
    if camera.state == PoseState.DRIFTING and any(
        alert.kind == AlertKind.CLOCK for alert in camera.alerts
    ):
        return "people seem to walk too fast or too slowly: its clock or frame rate looks wrong"
    if camera.alert is not None and camera.alert.kind == AlertKind.STALE:
        return "its estimate is not being made: what was seen last may be long ago"
    if camera.state == PoseState.LEARNING:
        return _learning(camera)
    if camera.state == PoseState.NO_DATA:
        silent_s = now.timestamp() - (camera.last_track_s or now.timestamp())
        return f"no people seen for {duration(silent_s)}, longer than is usual here"
    moved = drift_words(camera.drift)
    if camera.state == PoseState.OK and not camera.judged:
        return "where it should be, as somebody said; the next people will tell"
    if moved and not camera.judged:
        moved = f"{moved} when it was last told"
    if camera.state == PoseState.DRIFTING:
        return moved or "moved, but by how much is not told yet"
    return "standing still"


def drift_words(drift: Drift | None) -> str:
    """How far a camera has moved: "turned 2.1° (tilt +1.9°, pan −0.8°), 12 cm lower"."""
    if drift is None:
        return ""
    parts = []
    named = ", ".join(
        f"{NAMES[name]} {degrees(drift.by.of(name), signed=True)}"
        for name in ANGLES
        if name in drift.identifiable and drift.by.of(name)
    )
    if named:
        parts.append(f"turned {degrees(drift.angle_rad)} ({named})")
    if "height" in drift.identifiable and abs(drift.by.height_m) >= 0.005:
        parts.append(height_change(drift.by.height_m))
    return ", ".join(parts)


def height_change(metres: float) -> str:
    """By how much higher or lower: "12 cm lower", "1.3 m higher"."""
    way = "higher" if metres > 0 else "lower"
    if abs(metres) < 0.995:
        return f"{abs(metres) * 100:.0f} cm {way}"
    return f"{abs(metres):.1f} m {way}"


def degrees(radians: float, *, signed: bool = False) -> str:
    """An angle: "2.1°", "+1.9°", "−0.8°"."""
    text = f"{math.degrees(radians):+.1f}" if signed else f"{math.degrees(abs(radians)):.1f}"
    return text.replace("-", "\N{MINUS SIGN}") + "°"


def duration(seconds: float) -> str:
    """A length of time, roughly: "40 seconds", "12 minutes", "3 hours", "4 days"."""
    return format_timedelta(round(max(seconds, 0.0)), threshold=_AT_LEAST, locale="en")


def ago(at: datetime, now: datetime) -> str:
    """How long ago a time was, or in how long it is; `times.js` says the same as time goes on."""
    if now - _JUST_NOW[0] < at <= now + _JUST_NOW[1]:
        return "just now"
    # A whole number, since of a timedelta it would take the second before.
    seconds = round((at - now).total_seconds())
    return format_timedelta(seconds, threshold=_AT_LEAST, add_direction=True, locale="en")


def clock_time(at: datetime, zone: tzinfo) -> str:
    """A time by the cameras' clock."""
    return f"{at.astimezone(zone):%Y-%m-%d %H:%M %Z}"


def from_seconds(at_s: float) -> datetime:
    """The time of seconds since the epoch, as tracks have it."""
    return datetime.fromtimestamp(at_s, UTC)


def _learning(camera: FleetCamera) -> str:
    if camera.learned is not None:
        return f"learning what is usual: {camera.learned} of {camera.wanted} people"
    return "waiting for people to tell how it stands now"
