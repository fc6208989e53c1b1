"""The rest of a camera's page in words: pose parameters, activity, what a move means, flags."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, tzinfo

from models.geometry.misplacement import Misplacement
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PoseParameters
from models.quantiles import Z90
from service.enums import AlertKind, Outcome
from service.notifications.outbox import is_silenced
from service.pages.views.camera_page import CameraPage
from service.pages.wording.moments import when
from service.pages.wording.sentences import signed
from service.pages.wording.words import NAMES, ago
from service.reasons import ServiceCode
from service.store.estimates import EstimateRecord

KINDS = {
    AlertKind.DRIFT: "The camera moved",
    AlertKind.CLOCK: "The clock looks wrong",
    AlertKind.NO_DATA: "No people come",
    AlertKind.STALE: "Its estimate is not being made",
    AlertKind.TRACKER: "Another tracker posts",
}
OUTCOMES = {
    Outcome.PUT_BACK: "put back",
    Outcome.ACCEPTED: "new pose accepted",
    Outcome.FALSE_ALARM: "false alarm",
    Outcome.CLEARED: "ended by itself",
    Outcome.CAMERA_REMOVED: "camera removed",
}
_UNCHANGED_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Now, by the cameras' own clock: what templates say times with."""

    now: datetime
    zone: tzinfo

    def when(self, at: datetime) -> str:
        """A time in words."""
        return when(at, self.now, self.zone)

    def ago(self, at: datetime) -> str:
        """How long ago a time is, in words."""
        return ago(at, self.now)

    def of(self, seconds: float) -> datetime:
        """The time of seconds since the epoch."""
        return datetime.fromtimestamp(seconds, self.now.tzinfo)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """One pose parameter as text; `served`, `drift`, `sure` are empty if not identifiable."""

    name: str
    prior: str
    served: str
    drift: str
    sure: str


def parameter_rows(
    prior: CameraPose, served: CameraPose, estimate: EstimateRecord | None
) -> tuple[ParameterRow, ...]:
    """Pan, tilt, roll and height: prior, served, the drift, and half its 90 % interval."""
    identifiable = () if estimate is None else tuple(estimate.identifiable)
    rows = []
    for name, words in NAMES.items():
        poses = PoseParameters.of_pose(prior), PoseParameters.of_pose(served)
        before, after = (_shown(pose.of(name), name) for pose in poses)
        unit, digits = (" m", 2) if name == "height" else ("°", 1)
        row = {"name": words.capitalize(), "prior": _text(before, digits) + unit}
        if estimate is not None and name in identifiable:
            drift, sd = (_shown(value, name) for value in estimate.drift.of(name))
            row |= {
                "served": _text(after, digits) + unit,
                "drift": f"{signed(drift, digits)}{unit}",
                "sure": f"±{max(Z90 * sd, 10.0**-digits):.{digits}f}{unit}",
            }
        rows.append(ParameterRow(**{"served": "", "drift": "", "sure": "", **row}))
    return tuple(rows)


def misplaced_words(each: Sequence[Misplacement]) -> str:
    """What a move means on the ground: "A person at 10 m is now placed 1.7 m too far, …"."""
    if not each:
        return ""
    if all(one.off_m is not None and one.off_m < _UNCHANGED_M for one in each):
        far = each[-1].distance_m
        return f"By the prior pose, people up to {far:.0f} m away are placed where they stand."
    first, *others = each
    parts = [f"A person at {first.distance_m:.0f} m is now placed {_off_words(first)}"]
    parts += [f"one at {one.distance_m:.0f} m {_off_words(one)}" for one in others]
    return f"{', '.join(parts)}."


def _off_words(one: Misplacement) -> str:
    if one.off_m is None or one.farther_m is None:
        return "above the horizon, which is nowhere"
    way = ""
    # Mostly along the line of sight; else to a side.
    if abs(one.farther_m) > 0.7 * one.off_m and one.off_m >= _UNCHANGED_M:
        way = " too far" if one.farther_m > 0 else " too near"
    return f"{one.off_m:.1f} m{way or ' off'}"


def flags(page: CameraPage, clock: Clock) -> tuple[str, ...]:
    """What else is to be known at a glance, of open alerts and maintenance."""
    found = [
        f"Without the {str(lack.values['part']).replace('_', ' ')}"
        for lack in page.camera.record.lacks
        if lack.code == ServiceCode.WITHOUT_PART
    ]
    if page.attended is not None:
        found.append(f"Maintenance until {clock.when(page.attended.to_at)}")
    for story in page.firing:
        record = story.record
        if record.acknowledged_at is not None:
            found.append(f"Acknowledged by {record.acknowledged_by}")
        if record.silenced_until is not None and is_silenced(record, page.now):
            found.append(f"Silenced until {clock.when(record.silenced_until)}")
        if story.group is not None:
            cameras = len(story.group.camera_ids or [])
            found.append(f"One of {cameras} cameras of {record.track_source} at once")
    return tuple(dict.fromkeys(found))


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def _shown(value: float, name: str) -> float:
    return value if name == "height" else math.degrees(value)
