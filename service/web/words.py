"""What is known of a camera in plain words, for who watches hundreds of them."""

import math
from datetime import UTC, datetime, tzinfo

from service.recalibration.camera_state import PoseState
from service.recalibration.fleet import FleetCamera, FleetDrift

STATES: dict[PoseState, str] = {
    "drifting": "Moved",
    "out_of_range": "Far off",
    "no_data": "No people",
    "learning": "Learning",
    "ok": "Steady",
}
_MINUTE_S, _HOUR_S, _DAY_S = 60.0, 3600.0, 86_400.0


def situation(camera: FleetCamera, now: datetime) -> str:
    """What a camera does, in one line."""
    if camera.state == "drifting" and any(alert.kind == "clock" for alert in camera.alerts):
        return "people seem to walk too fast or too slowly: its clock or frame rate looks wrong"
    if camera.alert is not None and camera.alert.kind == "stale":
        return "its estimate is not being made: what was seen last may be long ago"
    if camera.state == "learning":
        return _learning(camera)
    if camera.state == "no_data":
        silent_s = now.timestamp() - (camera.last_track_s or now.timestamp())
        return f"no people seen for {duration(silent_s)}, longer than is usual here"
    moved = drift_words(camera.drift)
    if camera.state == "ok" and not camera.judged:
        return "where it should be, as somebody said; the next people will tell"
    if moved and not camera.judged:
        moved = f"{moved} when it was last told"
    if camera.state == "out_of_range":
        return f"{moved or 'moved'}: further than it was trained for, so this is rough"
    if camera.state == "drifting":
        return moved or "moved, but by how much is not told yet"
    return "standing still"


def drift_words(drift: FleetDrift | None) -> str:
    """How far a camera has moved: "turned 2.1° (tilt +1.9°, pan −0.8°), 12 cm lower"."""
    if drift is None:
        return ""
    parts = []
    turns = [("tilt", drift.tilt_rad), ("roll", drift.roll_rad), ("pan", drift.heading_rad)]
    named = ", ".join(f"{name} {degrees(value, signed=True)}" for name, value in turns if value)
    if drift.angle_rad is not None and named:
        parts.append(f"turned {degrees(drift.angle_rad)} ({named})")
    if drift.height_m is not None and abs(drift.height_m) >= 0.005:
        parts.append(height_change(drift.height_m))
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
    """A length of time, roughly: "40 s", "12 min", "3 h", "4 days"."""
    if seconds < 1.5 * _MINUTE_S:
        return f"{max(seconds, 0):.0f} s"
    if seconds < 1.5 * _HOUR_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    if seconds < 1.5 * _DAY_S:
        return f"{seconds / _HOUR_S:.0f} h"
    return f"{seconds / _DAY_S:.0f} days"


def ago(at: datetime, now: datetime) -> str:
    """How long ago a time was; `times.js` says it the same way as time goes on."""
    seconds = (now - at).total_seconds()
    if seconds < -_MINUTE_S:
        return f"in {duration(-seconds)}"
    return "just now" if seconds < 10 else f"{duration(seconds)} ago"


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
