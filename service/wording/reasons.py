"""Reasons in words: why a state is what it is, an alert fired, a part is missing."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, tzinfo
from enum import StrEnum
from typing import Any

from models.durations import HOUR_S
from models.geometry.pose import PARAMETERS
from models.quantiles import Z90
from models.reasons import Reason, TracksCode
from service.degrees import in_degrees
from service.enums import Cause
from service.reasons import ServiceCode

_Values = Mapping[str, Any]
_SINCE = {
    Cause.REFERENCE: "since the reference",
    Cause.MAINTENANCE: "since the maintenance",
    Cause.PUT_BACK: "since the camera was put back",
    Cause.MENDED: "since the clock was mended",
    Cause.FALSE_ALARM: "since the alert was called a false alarm",
}
_GROUPS = (ServiceCode.MOVED_TOGETHER, ServiceCode.FELL_SILENT_TOGETHER)


def in_words(reasons: Sequence[Reason], zone: tzinfo = UTC) -> str:
    """Reasons as one sentence without its full stop; empty where there are none.

    Times in them are said by a zone's clock.
    """
    said = ""
    for number, reason in enumerate(reasons):
        words, values = _WORDS[reason.code], {**_as_told(reason.values), "zone": zone}
        said += words.format(**values) if isinstance(words, str) else words(values)
        if number + 1 < len(reasons):
            said += " " if reason.code is ServiceCode.LAST_IDENTIFIABLE else "; "
    return said


def group_in_words(reasons: Sequence[Reason]) -> str:
    """Reasons of a tracker's alert, to stand beside the tracker's name."""
    return in_words(
        [
            replace(each, values={**each.values, "track_source": ""})
            if each.code in _GROUPS
            else each
            for each in reasons
        ]
    )


def _as_told(values: _Values) -> _Values:
    """Values as sentences say them: angles in degrees, and times in hours, too."""
    hours = {f"{name}_in_h": value / HOUR_S for name, value in values.items() if name[-2:] == "_s"}
    return in_degrees(values) | hours


def _limit(v: _Values) -> str:
    return f"{v['floor_deg']:g} deg or {v['floor_m']:g} m"


def _numbers(v: _Values) -> str:
    said = []
    for name in PARAMETERS:
        if name == "height" and "height_m" in v:
            said.append(f"height {v['height_m']:+.2f} m (sd {v['height_sd_m']:.2f})")
        elif f"{name}_deg" in v:
            said.append(f"{name} {v[f'{name}_deg']:+.2f} deg (sd {v[f'{name}_sd_deg']:.2f})")
    return f"{', '.join(said)} against the prior pose; moved: {percent(v['moved'])}"


def percent(share: float) -> str:
    """A probability in words, never quite sure: "97 %", "under 1 %", "over 99.9 %"."""
    if share < 0.01:
        return "under 1 %"
    if share > 0.999:
        return "over 99.9 %"
    return f"{100 * share:.1f} %" if share > 0.99 else f"{100 * share:.0f} %"


def _beyond_before(v: _Values) -> str:
    return f"{_numbers(v)}: was beyond {_limit(v)}; it ends once a move is unlikely"


def _chart(v: _Values) -> str:
    if v["number"] == "times":
        what = f"all times were too {'long' if v['sign'] > 0 else 'short'}"
    else:
        what = f"the {v['number']} had gone {'up' if v['sign'] > 0 else 'down'}"
    return (
        f"the last {v['parties']} walking groups walk as they would if {what} "
        f"(drift chart: {v['statistic']:.0f}, alarm at {v['level']:.0f})"
    )


def _crept(v: _Values) -> str:
    return (
        f"has crept by {v['by_deg']:+.1f} deg (sd {v['sd_deg']:.1f}) in {v['number']} since "
        f"{datetime.fromisoformat(v['since']):%Y-%m-%d}, by the first map and speeds of its "
        f"reference (creep: {v['statistic']:.0f}, alarm at {v['level']:.0f})"
    )


def _scale_changed(v: _Values) -> str:
    factor, rate_hz = v["factor"], v["rate_hz"]
    return (
        f"the scale has changed by {100 * (factor - 1):+.0f} % and the angles have not: as if "
        f"{rate_hz * factor:.3g} frames a second were taken for {rate_hz:.3g}, or the camera was "
        f"{'raised' if factor > 1 else 'lowered'}"
    )


def _ambiguous(v: _Values) -> str:
    said = " and ".join(f"{turn:+.1f} deg" for turn in v["turns_deg"])
    return f"turns of {said} explain where people walk about as well"


def _unidentifiable(v: _Values) -> str:
    said = [
        f"{name} (sd {v[f'{name}_sd_deg']:.1f} deg)"
        for name in ("tilt", "roll")
        if f"{name}_sd_deg" in v
    ]
    if "log_height_sd" in v:
        said.append(f"height (sd {100 * v['log_height_sd']:.0f} %)")
    text = "the tracks cannot tell " + " and ".join(said)
    if "alike" in v:
        first, second = v["alike"]
        text += (
            f": people walk too much alike, one way or along one path, and {first} makes up for "
            f"{second}"
        )
    return text


def _few_groups(v: _Values) -> str:
    return (
        f"the {v['tracks']} tracks are of {v['parties']} "
        f"{'walking group' if v['parties'] == 1 else 'walking groups'}, at least "
        f"{v['least_parties']} are needed to tell the camera's drift from theirs"
    )


def _since(v: _Values) -> str:
    return (
        f"{v['tracks']} tracks {_SINCE[Cause(v['cause'])]}; at least {v['least_walkers']} of "
        "people who walk for a few seconds inside the image are needed"
    )


def _sure_of_pose(v: _Values) -> str:
    """How sure a proposed pose is: nine cases of ten are within that."""
    return (
        f"sure to {Z90 * v['tilt_sd_deg']:.1f}° in tilt, {Z90 * v['roll_sd_deg']:.1f}° in roll, "
        f"{Z90 * v['height_sd_m']:.1f} m in height"
    )


def _maintenance(v: _Values) -> str:
    at = datetime.fromisoformat(v["until"]).astimezone(v["zone"])
    until = f"maintenance is under way until {at:%Y-%m-%d %H:%M}{'Z' if v['zone'] is UTC else ''}"
    return f"{until} ({v['note']})" if v.get("note") else until


def _silent(v: _Values) -> str:
    words = f"no track for {v['silent_s_in_h']:.1f} h"
    if "missed_tracks" in v:
        words += f", where about {v['missed_tracks']:.0f} are usual by now"
    else:
        words += ", as is usual at this hour"
    late = v.get("late_s_in_h")
    return words if late is None else f"{words}; its tracks come up to {late:.1f} h late"


def _of_tracker(v: _Values) -> str:
    return f" of the tracker {v['track_source']!r}" if v["track_source"] else ""


def _moved_together(v: _Values) -> str:
    return (
        f"{v['cameras']} cameras{_of_tracker(v)} moved together: the tracker or its clock is "
        "the likely cause, rather than each camera by itself; cameras that hang on one mast or "
        "building would look the same"
    )


def _silent_together(v: _Values) -> str:
    return (
        f"{v['cameras']} cameras{_of_tracker(v)} fell silent together: the tracker, its "
        "network or its clock is the likely cause, rather than each camera by itself"
    )


def _other_sources(v: _Values) -> str:
    names, counting = " and ".join(repr(name) for name in v["sources"]), v.get("counting")
    return (
        f"tracks of {names} come beside those of {counting!r}, which count: they are kept "
        f"and move nothing. Should {counting!r} fall silent for {v['silent_s_in_h']:g} h, they "
        f"take over once {v['wanted']} of them were seen while the camera was where it "
        "should be; a person can say so at once"
    )


# A text takes the values by their names.
_WORDS: dict[StrEnum, str | Callable[[_Values], str]] = {
    TracksCode.BEYOND_LIMITS: lambda v: f"{_numbers(v)}, by more than {_limit(v)}",
    TracksCode.SUSPECTED: lambda v: f"{_numbers(v)}, which is not sure enough for an alert",
    TracksCode.BEYOND_LIMITS_BEFORE: _beyond_before,
    TracksCode.BEYOND_LIMITS_LAST_IDENTIFIABLE: lambda v: (
        f"beyond {_limit(v)} when it was last told"
    ),
    TracksCode.WITHIN_LIMITS: _numbers,
    TracksCode.CHART: _chart,
    TracksCode.CREPT: _crept,
    TracksCode.SCALE_CHANGED: _scale_changed,
    TracksCode.PATHS_CHANGED: (
        "people walk on none of the paths that were learned: the camera was turned far, or they "
        "walk elsewhere"
    ),
    TracksCode.WAYS_CHANGED: (
        "people walk the same ground other ways than they did: where they do tells no pose"
    ),
    TracksCode.HEADING_AMBIGUOUS: _ambiguous,
    TracksCode.HEADING_UNIDENTIFIABLE: (
        "where people walk does not tell the heading (sd {heading_sd_deg:.1f} deg)"
    ),
    TracksCode.UNIDENTIFIABLE: _unidentifiable,
    TracksCode.TOO_FEW_GROUPS: _few_groups,
    TracksCode.SPEED_UNUSUAL: (
        "people walk at {speed_mps:.2f} m/s at the prior pose, {slow_mps:g} to {fast_mps:g} m/s "
        "is usual: the prior height or the frame rate is wrong"
    ),
    TracksCode.STATURE_UNUSUAL: (
        "boxes say that people are {stature_m:.2f} m tall at the prior pose, {short_m:g} to "
        "{tall_m:g} m is usual: the prior height is wrong"
    ),
    TracksCode.PRIOR_POSE_DOUBTED: (
        "the reference tracks put the camera {tilt_deg:+.1f} deg in tilt and {roll_deg:+.1f} deg "
        "in roll from its prior pose: the prior pose is wrong, or the camera had moved before"
    ),
    TracksCode.PIECES: (
        "{pieces:g} of {tracks:g} tracks are pieces of others' walks: the tracker loses people, "
        "each of whom counts once"
    ),
    ServiceCode.AS_SAID: "{text}",
    ServiceCode.NOBODY_POSTED: "no track of anybody has been posted for it yet",
    ServiceCode.POSE_UNKNOWN: lambda v: (
        f"its pose is found by the people before it: {v['tracks']} tracks so far, of "
        f"{v['least_walkers']} or more that walk"
    ),
    ServiceCode.POSE_UNTOLD: lambda v: (
        f"{v['tracks']} tracks of {v['groups']} people or groups do not tell its pose yet"
        f" ({_sure_of_pose(v)}); more people help, and such as walk other ways"
    ),
    ServiceCode.POSE_PROPOSED: lambda v: (
        f"{v['tracks']} tracks tell its pose ({_sure_of_pose(v)}); somebody has to agree to it"
    ),
    ServiceCode.LEARNING_REFERENCE: "the reference is being learned",
    ServiceCode.REFERENCE_TRACKS: lambda v: (
        f"{v['counted']} of {v['wanted']} people for the reference"
        + (
            f"; {v['pieces']} of {v['tracks']} tracks are pieces of others' walks"
            if v["pieces"]
            else ""
        )
    ),
    ServiceCode.TRACKS_SINCE: _since,
    ServiceCode.LAST_IDENTIFIABLE: "when it was last told:",
    ServiceCode.MAINTENANCE: _maintenance,
    ServiceCode.WITHOUT_PART: lambda v: f"without the {v['part'].replace('_', ' ')}: {v['why']}",
    ServiceCode.BY_PICTURE: "by a picture of {taken_at}, nobody having walked by since",
    ServiceCode.SITE_CHANGED: (
        "the picture says that it stands, and people walk elsewhere: the site changed"
    ),
    ServiceCode.PICTURE_SHIFTED: (
        "near and far things moved apart in the picture: the camera was moved aside, too, and how "
        "far it turned is known less well"
    ),
    ServiceCode.PICTURE_FROZEN: "the same picture for {unchanged_s_in_h:.1f} h",
    ServiceCode.PICTURE_BLACK: "its picture is black",
    ServiceCode.PICTURE_BLINDED: "it is blinded: far more of its picture is white than ever",
    ServiceCode.PICTURE_COVERED: "something covers its view",
    ServiceCode.PICTURE_DEFOCUSED: "its picture is out of focus",
    ServiceCode.PICTURE_UPSIDE_DOWN: "its picture is upside down",
    ServiceCode.PICTURE_OTHER_SCENE: "its picture is of another scene: covered, or turned far",
    ServiceCode.SILENT_USUAL: _silent,
    ServiceCode.SILENT_UNUSUAL: _silent,
    ServiceCode.SILENT_UNKNOWN: (
        "the newest track ended {silent_s_in_h:.1f} h ago; up to {limit_s_in_h:g} h are waited for"
    ),
    ServiceCode.MOVED_TOGETHER: _moved_together,
    ServiceCode.FELL_SILENT_TOGETHER: _silent_together,
    ServiceCode.OTHER_SOURCES: _other_sources,
    ServiceCode.LOOKS_FAIL: (
        "its tracks cannot be looked at: {tries} tries failed in a row, the last with {error}"
    ),
    ServiceCode.TRACKS_WAIT: lambda v: (
        f"its tracks have waited for {v['waits_s'] / 60:.0f} min; up to {v['limit_s'] / 60:g} min "
        "are waited for"
    ),
    ServiceCode.TRACKS_LEFT_OUT: lambda v: (
        f"{v['tracks']} of its tracks are not looked at, for a look would take too long of them: "
        + ", ".join(f"{name!r}" for name in v["track_ids"])
        + (" and others" if v["tracks"] > len(v["track_ids"]) else "")
    ),
    ServiceCode.DISABLED_BY_PERSON: "disabled by a person",
    ServiceCode.ENDPOINT_GONE: "it answered 410: it is gone for good",
    ServiceCode.ENDPOINT_FAILS: "it failed for more than {patience_s_in_h:g} h: {error}",
    ServiceCode.SECRET_LOST: (
        "its secret was lost with the key: fetch a new one, tell the receiver, enable it"
    ),
}
