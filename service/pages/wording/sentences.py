"""The one sentence at the top of a camera's page: has it moved, how far, since when, how sure."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime, tzinfo

from models.geometry.plane_parameters import ANGLES
from models.quantiles import Z90
from service.enums import AlertKind, PoseState
from service.pages.views.camera_page import CameraPage
from service.pages.wording.moments import when
from service.pages.wording.words import NAMES, duration
from service.reason_words import in_words
from service.store.alerts import POSE_KINDS, AlertRecord
from service.store.estimates import EstimateRecord

_SAYS_DEG = 0.1  # less is not worth a word


def headline(page: CameraPage, zone: tzinfo) -> str:
    """The state of a camera in plain words."""
    standing, estimate = page.pose.standing, page.pose.estimate
    quiet = ""
    if page.silence is not None and standing.silent and standing.state != PoseState.LEARNING:
        since = when(datetime.fromtimestamp(page.silence.last_s, UTC), page.now, zone)
        quiet = f"No people since {since}: {in_words(page.silence.reasons)}."
    return " ".join(part for part in (_how_it_stands(page, estimate, zone), quiet) if part)


def _how_it_stands(page: CameraPage, estimate: EstimateRecord | None, zone: tzinfo) -> str:
    standing = page.pose.standing
    state, known = standing.state, estimate is not None and bool(estimate.identifiable)
    doubts = [alert for alert in standing.alerts if alert.kind in POSE_KINDS]
    if state == PoseState.DRIFTING and not standing.judged:
        words = _moved(page, estimate, zone) if estimate is not None and known else _alarmed(doubts)
        return f"{words} That is what is known last: the next people will tell how it stands now."
    if estimate is not None and standing.judged and estimate.drifted:
        return _moved(page, estimate, zone)
    if doubts:  # of a reference, or about a move whose size is not identifiable
        return _alarmed(doubts)
    if state == PoseState.LEARNING or estimate is None or not standing.judged:
        return _waiting(page)
    if state == PoseState.NO_DATA:
        return "When it was last told, it stood where it should."
    people = (
        f"{estimate.tracks} people of the last {duration(estimate.to_s - estimate.from_s)} show"
    )
    if estimate.drift_streak > 0 or estimate.suspected:
        how = moved_words(estimate)
        return f"It may have moved{how and ': it ' + how}. The next people will tell."
    return f"Standing where it should, as {people}{_sure(estimate)}."


def _alarmed(doubts: Sequence[AlertRecord]) -> str:
    return f"It may not stand where it should: {doubts[0].reason}."


def turn_words(estimate: EstimateRecord) -> str:
    """How far a camera has turned: "turned 5.1° (pan +4.9°, tilt −1.2°)"; empty if none is known.

    What is within its own 90 % interval is not named.
    """
    angles = [name for name in ("heading", "tilt", "roll") if name in estimate.identifiable]
    named = [
        f"{NAMES[name]} {signed(_degrees(estimate, name), 1)}°"
        for name in angles
        if abs(_degrees(estimate, name)) >= _says_deg(estimate, name)
    ]
    if not angles:
        return ""
    detail = f" ({', '.join(named)})" if named else ""
    return f"turned {math.degrees(estimate.drift_angle_rad):.1f}°{detail}"


def height_words(estimate: EstimateRecord) -> str:
    """How far a camera was raised or lowered: "0.24 m higher"; empty where unidentifiable."""
    if "height" not in estimate.identifiable or abs(estimate.drift_by.height_m) < _height_says_m(
        estimate
    ):
        return ""
    way = "higher" if estimate.drift_by.height_m > 0 else "lower"
    return f"{abs(estimate.drift_by.height_m):.2f} m {way}"


def moved_words(estimate: EstimateRecord, since: str = "") -> str:
    """How a camera has moved, after its name: "turned 5.1° (tilt +5.1°) and is 0.24 m higher"."""
    turn, height = turn_words(estimate), height_words(estimate)
    if height and estimate.drifted == ["height"]:
        return f"is {height} than it should be{since and ', since'}{since}"
    parts = [f"{turn}{since}" if turn else "", f"is {height}" if height else ""]
    return " and ".join(part for part in parts if part)


def signed(value: float, digits: int) -> str:
    """A number with its sign, a real minus, and never a minus nought."""
    text = f"{value:+.{digits}f}"
    return ("0" + text[2:] if float(text) == 0 else text).replace("-", "\N{MINUS SIGN}")


def angle_half_width_deg(estimate: EstimateRecord) -> float | None:
    """Half the 90 % interval of the angle that a camera has turned by; None where none is known."""
    known = [name for name in ANGLES if name in estimate.identifiable]
    if not known:
        return None
    drifts = [_degrees(estimate, name) for name in known]
    sds = [math.degrees(estimate.pose_sd.of(name)) for name in known]
    length = math.hypot(*drifts)
    if length < max(sds):  # without a direction, the widest
        return Z90 * max(sds)
    # By the direction of the turn: the angle is the length of the three drifts, nearly.
    return Z90 * math.hypot(*(d * sd for d, sd in zip(drifts, sds, strict=True))) / length


def _moved(page: CameraPage, estimate: EstimateRecord, zone: tzinfo) -> str:
    since = ""
    if estimate.drift_since is not None:
        since = f" about {when(estimate.drift_since, page.now, zone)}"
    if any(story.record.kind == AlertKind.CLOCK for story in page.firing):
        how = moved_words(estimate)
        return (
            f"People seem to walk at another speed{since and ' since' + since}: a wrong clock or "
            f"frame rate looks like that{how and ', or the camera ' + how}{_sure(estimate)}."
        )
    words = moved_words(estimate, since)
    if not words or not set(estimate.drifted) & set(estimate.identifiable):
        return f"The camera moved{since}; the newest people cannot tell how far."
    return f"The camera {words}{_sure(estimate)}."


def _sure(estimate: EstimateRecord) -> str:
    parts = []
    half = angle_half_width_deg(estimate)
    if half is not None:
        parts.append(f"±{max(half, 0.1):.1f}°")
    if "height" in estimate.identifiable and (
        half is None or abs(estimate.drift_by.height_m) >= _height_says_m(estimate)
    ):
        parts.append(f"±{max(Z90 * estimate.pose_sd.height_m, 0.01):.2f} m")
    return f"; sure to {' and '.join(parts)}" if parts else ""


def _waiting(page: CameraPage) -> str:
    reference, standing = page.pose.reference, page.pose.standing
    if standing.state in (PoseState.OK, PoseState.NO_DATA):
        who = standing.reference.answered_by or "somebody"
        return f"Where it should be, as {who} said. The next people will tell."
    if not reference.ready:
        return f"Learning: {reference.tracks} of {reference.wanted} people."
    return "Waiting for people: too few have come to tell how it stands."


def _degrees(estimate: EstimateRecord, name: str) -> float:
    return math.degrees(estimate.drift_by.of(name))


def _says_deg(estimate: EstimateRecord, name: str) -> float:
    return max(Z90 * math.degrees(estimate.pose_sd.of(name)), _SAYS_DEG)


def _height_says_m(estimate: EstimateRecord) -> float:
    return max(Z90 * estimate.pose_sd.height_m, 0.05)
