"""The one sentence at the top of a camera's page: has it moved, how far, since when, how sure."""

import math
from datetime import UTC, datetime, tzinfo

from models.estimation.numbers import ANGLES
from service.recalibration.camera_page import CameraPage
from service.store.tables import EstimateRecord
from service.web.moments import when
from service.web.words import duration

# Operators say pan. Height is told apart.
NAMES = {"heading": "pan", "tilt": "tilt", "roll": "roll", "height": "height"}
Z90 = 1.645  # standard deviations to each side of an interval that holds in 90 of 100 cases
_SAYS_DEG = 0.1  # less is not worth a word


def headline(page: CameraPage, zone: tzinfo) -> str:
    """The state of a camera in plain words."""
    estimate, silence = page.pose.estimate, page.silence
    no_data = page.pose.state == "no_data"
    quiet = ""
    if silence is not None and no_data:
        since = when(datetime.fromtimestamp(silence.last_s, UTC), page.now, zone)
        quiet = f"No people since {since}: {silence.reason}."
    if estimate is not None and estimate.drifted:
        return " ".join(part for part in (_moved(page, estimate, zone), quiet) if part)
    if no_data:
        before = "" if estimate is None else "When it was last told, it stood where it should."
        return f"{quiet} {before}".strip()
    if page.pose.state == "learning" or estimate is None:
        return _learning(page)
    people = (
        f"{estimate.tracks} people of the last {duration(estimate.to_s - estimate.from_s)} show"
    )
    if page.pose.state == "out_of_range":
        return (
            f"At the edge of what its model was trained for: {turned(estimate)}, as {people}. "
            "No alert of a drift yet."
        )
    if estimate.drift_streak > 0 or estimate.suspected:
        return f"It may have moved: {turned(estimate)}. The next people will tell."
    return f"Standing where it should, as {people}{_sure(estimate)}."


def turned(estimate: EstimateRecord) -> str:
    """How far, in words, which numbers, and how sure: of what is told."""
    parts = []
    angles = [name for name in ("heading", "tilt", "roll") if name in estimate.told]
    if angles:
        each = [f"{NAMES[name]} {signed(_degrees(estimate, name), 1)}°" for name in angles]
        large = [
            text
            for name, text in zip(angles, each, strict=True)
            if abs(_degrees(estimate, name)) >= _SAYS_DEG
        ]
        # A lone angle has said it all.
        detail = f" ({', '.join(large)})" if large and len(angles) > 1 else ""
        whole = f"{math.degrees(estimate.drift_angle_rad):.1f}°"
        parts.append(f"turned by {whole}{detail}")
    if "height" in estimate.told and abs(estimate.drift_height_m) >= _height_says_m(estimate):
        way = "higher" if estimate.drift_height_m > 0 else "lower"
        parts.append(f"{abs(estimate.drift_height_m):.2f} m {way}")
    text = " and ".join(parts) or "nothing that the tracks could tell"
    return text


def signed(value: float, digits: int) -> str:
    """A number with its sign, a real minus, and never a minus nought."""
    text = f"{value:+.{digits}f}"
    return ("0" + text[2:] if float(text) == 0 else text).replace("-", "\u2212")


def angle_half_width_deg(estimate: EstimateRecord) -> float | None:
    """Half the 90 % interval of the angle that a camera has turned by; None where none is told."""
    told = [name for name in ANGLES if name in estimate.told]
    if not told:
        return None
    drifts = [_degrees(estimate, name) for name in told]
    sds = [math.degrees(_sd(estimate, name)) for name in told]
    length = math.hypot(*drifts)
    if length < max(sds):  # without a direction, the widest
        return Z90 * max(sds)
    # By the direction of the turn: the angle is the length of the three drifts, nearly.
    return Z90 * math.hypot(*(d * sd for d, sd in zip(drifts, sds, strict=True))) / length


def _moved(page: CameraPage, estimate: EstimateRecord, zone: tzinfo) -> str:
    since = ""
    if estimate.drift_since is not None:
        since = f" about {when(estimate.drift_since, page.now, zone)}"
    if any(story.record.kind == "clock" for story in page.firing):
        return (
            f"People seem to walk at another speed{since and ' since' + since}: a wrong clock or "
            f"frame rate looks like that, or the camera is {turned(estimate)}{_sure(estimate)}."
        )
    if not estimate.told:
        return f"The camera moved{since}; the newest people cannot tell how far."
    text = turned(estimate)
    if text.startswith("turned by"):
        return f"The camera {text}{since}{_sure(estimate)}."
    return f"The camera is {text} than it should be{since and ', since' + since}{_sure(estimate)}."


def _sure(estimate: EstimateRecord) -> str:
    parts = []
    half = angle_half_width_deg(estimate)
    if half is not None:
        parts.append(f"±{max(half, 0.1):.1f}°")
    if "height" in estimate.told and (
        half is None or abs(estimate.drift_height_m) >= _height_says_m(estimate)
    ):
        parts.append(f"±{max(Z90 * estimate.height_sd_m, 0.01):.2f} m")
    return f"; sure to {' and '.join(parts)}" if parts else ""


def _learning(page: CameraPage) -> str:
    reference = page.pose.reference
    if not reference.ready:
        return f"Learning: {reference.tracks} of {reference.wanted} people."
    return "Waiting for people: too few have come to tell how it stands."


def _degrees(estimate: EstimateRecord, name: str) -> float:
    return math.degrees(float(getattr(estimate, f"drift_{name}_rad")))


def _sd(estimate: EstimateRecord, name: str) -> float:
    return float(getattr(estimate, f"{name}_sd_rad") or 0.0)


def _height_says_m(estimate: EstimateRecord) -> float:
    return max(Z90 * estimate.height_sd_m, 0.05)
