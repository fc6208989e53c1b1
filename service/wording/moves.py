"""Moves of cameras in words: how far one turned or rose, how sure that is, what it means."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from models.geometry.ground import Misplacement
from models.geometry.pose import ANGLES, FIELDS, CameraPose, PoseParameters
from models.monitoring.drift import Drift
from models.quantiles import Z90
from service.store.estimates import EstimateRecord
from service.wording.language import N_, _, number

# Operators say pan. Height is told apart.
NAMES = {"heading": N_("pan"), "tilt": N_("tilt"), "roll": N_("roll"), "height": N_("height")}
TOLD_BY = 250  # people
_SAYS_DEG, _SAYS_M = 0.1, 0.05  # less is not worth a word


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """One pose parameter as text; `served`, `drift`, `sure` are empty if not identifiable.

    `told` is the smallest move that so many people would tell; empty where none would be.
    """

    name: str
    prior: str
    served: str = ""
    drift: str = ""
    sure: str = ""
    told: str = ""


def parameter_rows(
    prior: CameraPose, served: CameraPose, estimate: EstimateRecord | None
) -> tuple[ParameterRow, ...]:
    """Pan, tilt, roll and height: prior, served, the drift, and half its 90 % interval."""
    rows = []
    for name, words in NAMES.items():
        poses = PoseParameters.of_pose(prior), PoseParameters.of_pose(served)
        before, after = (_shown(pose.of(name), name) for pose in poses)
        unit, digits = (" m", 2) if name == "height" else ("°", 1)
        row = {"name": _(words).capitalize(), "prior": _minus(before, f".{digits}f") + unit}
        if estimate is not None and name in estimate.identifiable:
            drift, sd = (_shown(value, name) for value in estimate.drift.of(name))
            row |= {
                "served": _minus(after, f".{digits}f") + unit,
                "drift": f"{signed(drift, digits)}{unit}",
                "sure": f"±{number(max(Z90 * sd, 10.0**-digits), f'.{digits}f')}{unit}",
            }
        if estimate is not None and (least := _least_told(estimate, name)) is not None:
            row["told"] = number(least, f".{digits}f") + unit
        rows.append(ParameterRow(**row))
    return tuple(rows)


def deaf_words(estimate: EstimateRecord | None) -> str:
    """What no number of people would tell of a camera, and what would help; empty where nothing."""
    notice = {} if estimate is None else estimate.detectable
    if not notice or notice["heading_rad"] is not None:
        return ""
    return _(
        "A pan would not be told: where people walk does not tell the heading. It would with more "
        "people in the reference, or with people who go more than one way."
    )


def moved_words(estimate: EstimateRecord, since: str = "") -> str:
    """The move of a camera after its name: "turned 5.1° (tilt +5.1°) and is 0.24 m higher"."""
    turn, height = _turn_words(estimate), _height_words(estimate)
    if height and estimate.drifted == ["height"]:
        height = _("is {height} than it should be", height=height)
        return f"{height}, {_('since about {time}', time=since)}" if since else height
    if turn and since:
        turn = _("{turn} about {time}", turn=turn, time=since)
    parts = [turn, _("is {height}", height=height) if height else ""]
    return _(" and ").join(part for part in parts if part)


def proposed_rows(pose: CameraPose, sd: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Name, value and half the 90 % interval of each number of a proposed pose; pan by a map."""
    angles = {_("Tilt"): "tilt_rad", _("Roll"): "roll_rad", _("Pan"): "heading_rad"}
    return [
        (
            _("Height"),
            f"{number(pose.height_m, '.1f')} m",
            f"±{number(Z90 * sd['height_m'], '.1f')} m",
        ),
        *(
            (
                name,
                f"{number(math.degrees(getattr(pose, field)), '.1f')}°",
                f"±{number(math.degrees(Z90 * sd[field]), '.1f')}°",
            )
            for name, field in angles.items()
            if field in sd
        ),
    ]


def sure_words(estimate: EstimateRecord) -> str:
    """Half the 90 % intervals, to follow a sentence: "; sure to ±0.3° and ±0.05 m"."""
    parts = []
    half = angle_half_width_deg(estimate)
    if half is not None:
        parts.append(f"±{number(max(half, 0.1), '.1f')}°")
    tells_height = half is None or abs(estimate.drift_by.height_m) >= _least_height_m(estimate)
    if "height" in estimate.identifiable and tells_height:
        parts.append(f"±{number(max(Z90 * estimate.pose_sd.height_m, 0.01), '.2f')} m")
    return "; " + _("sure to {numbers}", numbers=_(" and ").join(parts)) if parts else ""


def angle_half_width_deg(estimate: EstimateRecord) -> float | None:
    """Half the 90 % interval of the angle that a camera has turned by; None where none is known."""
    known = [name for name in ANGLES if name in estimate.identifiable]
    if not known:
        return None
    drifts = [math.degrees(estimate.drift_by.of(name)) for name in known]
    sds = [math.degrees(estimate.pose_sd.of(name)) for name in known]
    length = math.hypot(*drifts)
    if length < max(sds):  # without a direction, the widest
        return Z90 * max(sds)
    # By the direction of the turn: the angle is the length of the three drifts, nearly.
    return Z90 * math.hypot(*(d * sd for d, sd in zip(drifts, sds, strict=True))) / length


def drift_words(drift: Drift | None) -> str:
    """A drift in a line: "turned 2.1° (tilt +1.9°, pan −0.8°), 12 cm lower"."""
    if drift is None:
        return ""
    parts = []
    named = ", ".join(
        f"{_(NAMES[name])} {_minus(math.degrees(drift.by.of(name)), '+.1f')}°"
        for name in ANGLES
        if name in drift.identifiable and drift.by.of(name)
    )
    if named:
        parts.append(_("turned {deg:.1f}°", deg=math.degrees(abs(drift.angle_rad))) + f" ({named})")
    if "height" in drift.identifiable and abs(drift.by.height_m) >= 0.005:
        parts.append(height_change(drift.by.height_m))
    return ", ".join(parts)


def offset_words(drift: Mapping[str, Any]) -> str:
    """An alert's kept drift in a line: "tilt +1.9°, pan −0.8°, 12 cm lower"; may be empty."""
    parts = [
        f"{_(NAMES[name])} {signed(math.degrees(drift[FIELDS[name]]), 1)}°"
        for name in ("heading", "tilt", "roll")
        if drift.get(FIELDS[name])
    ]
    height_m = drift.get(FIELDS["height"])
    if height_m is not None and abs(height_m) >= _SAYS_M:
        parts.append(height_change(height_m))
    return ", ".join(parts)


def height_change(metres: float) -> str:
    """A change of height: "12 cm lower", "1.3 m higher"."""
    if abs(metres) < 0.995:
        return _height_by(f"{abs(metres) * 100:.0f} cm", metres)
    return _height_by(f"{number(abs(metres), '.1f')} m", metres)


def _height_by(size: str, metres: float) -> str:
    return _("{size} higher", size=size) if metres > 0 else _("{size} lower", size=size)


def misplaced_words(each: Sequence[Misplacement]) -> str:
    """A move's meaning on the ground: "A person at 10 m is now placed 1.7 m too far, …"."""
    if not each:
        return ""
    if all(one.off_m is not None and one.off_m < _SAYS_M for one in each):
        far = each[-1].distance_m
        return _(
            "By the prior pose, people up to {m:.0f} m away are placed where they stand.", m=far
        )
    first, *others = each
    parts = [
        _("A person at {m:.0f} m is now placed {off}", m=first.distance_m, off=_off_words(first)),
        *(_("one at {m:.0f} m {off}", m=one.distance_m, off=_off_words(one)) for one in others),
    ]
    return f"{', '.join(parts)}."


def signed(value: float, digits: int) -> str:
    """A number with its sign, a real minus, and never a minus nought."""
    zero = float(f"{value:.{digits}f}") == 0
    return _minus(0.0, f".{digits}f") if zero else _minus(value, f"+.{digits}f")


def _turn_words(estimate: EstimateRecord) -> str:
    """A turn: "turned 5.1° (pan +4.9°, tilt −1.2°)"; empty if no angle is known.

    What is within its own 90 % interval is not named.
    """
    angles = [name for name in ("heading", "tilt", "roll") if name in estimate.identifiable]
    if not angles:
        return ""
    named = [
        f"{_(NAMES[name])} {signed(math.degrees(estimate.drift_by.of(name)), 1)}°"
        for name in angles
        if abs(math.degrees(estimate.drift_by.of(name))) >= _least_angle_deg(estimate, name)
    ]
    detail = f" ({', '.join(named)})" if named else ""
    return _("turned {deg:.1f}°", deg=math.degrees(estimate.drift_angle_rad)) + detail


def _height_words(estimate: EstimateRecord) -> str:
    """A change of height: "0.24 m higher"; empty where unidentifiable."""
    by_m = estimate.drift_by.height_m
    if "height" not in estimate.identifiable or abs(by_m) < _least_height_m(estimate):
        return ""
    return _height_by(f"{number(abs(by_m), '.2f')} m", by_m)


def _least_told(estimate: EstimateRecord, name: str) -> float | None:
    """The smallest move of a number that `TOLD_BY` people would tell, as it is shown."""
    notice = estimate.detectable
    smallest = notice.get(FIELDS[name])
    if smallest is None:
        return None
    return _shown(smallest[notice["people"].index(TOLD_BY)], name)


def _least_angle_deg(estimate: EstimateRecord, name: str) -> float:
    return max(Z90 * math.degrees(estimate.pose_sd.of(name)), _SAYS_DEG)


def _least_height_m(estimate: EstimateRecord) -> float:
    return max(Z90 * estimate.pose_sd.height_m, _SAYS_M)


def _off_words(one: Misplacement) -> str:
    if one.off_m is None or one.farther_m is None:
        return _("above the horizon, which is nowhere")
    # Mostly along the line of sight; else to a side.
    if abs(one.farther_m) > 0.7 * one.off_m and one.off_m >= _SAYS_M:
        if one.farther_m > 0:
            return _("{m:.1f} m too far", m=one.off_m)
        return _("{m:.1f} m too near", m=one.off_m)
    return _("{m:.1f} m off", m=one.off_m)


def _minus(value: float, spec: str) -> str:
    return number(value, spec).replace("-", "\N{MINUS SIGN}")


def _shown(value: float, name: str) -> float:
    return value if name == "height" else math.degrees(value)
