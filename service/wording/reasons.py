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
from service.wording.language import N_, _, _n, number

_Values = Mapping[str, Any]
_SINCE = {
    Cause.REFERENCE: N_("since the reference"),
    Cause.MAINTENANCE: N_("since the maintenance"),
    Cause.PUT_BACK: N_("since the camera was put back"),
    Cause.FIXED: N_("since the clock was fixed"),
    Cause.FALSE_ALARM: N_("since the alert was called a false alarm"),
}
_NUMBERS = {
    "tilt": N_("tilt"),
    "roll": N_("roll"),
    "height": N_("height"),
    "heading": N_("heading"),
}
_GROUPS = (ServiceCode.MOVED_TOGETHER, ServiceCode.FELL_SILENT_TOGETHER)


def in_words(reasons: Sequence[Reason], zone: tzinfo = UTC) -> str:
    """Reasons as one sentence without its full stop; empty where there are none.

    Times in them are said by a zone's clock.
    """
    said = ""
    for n, reason in enumerate(reasons, 1):
        words, values = _WORDS[reason.code], {**_as_told(reason.values), "zone": zone}
        said += _(words, **values) if isinstance(words, str) else words(values)
        if n < len(reasons):
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
    return _("{floor_deg:g} deg or {floor_m:g} m", **v)


def _numbers(v: _Values) -> str:
    said = []
    for name in PARAMETERS:
        if name == "height" and "height_m" in v:
            said.append(_("height {height_m:+.2f} m (sd {height_sd_m:.2f})", **v))
        elif f"{name}_deg" in v:
            by, sd = v[f"{name}_deg"], v[f"{name}_sd_deg"]
            words = _(_NUMBERS[name])
            said.append(_("{number} {by:+.2f} deg (sd {sd:.2f})", number=words, by=by, sd=sd))
    share = percent(v["moved"])
    if not said:
        return _("moved: {share}", share=share)
    return _(
        "{numbers} against the prior pose; moved: {share}", numbers=", ".join(said), share=share
    )


def percent(share: float) -> str:
    """A probability in words, never quite sure: "97 %", "under 1 %", "over 99.9 %"."""
    if share < 0.01:
        return _("under {share} %", share=1)
    if share > 0.999:
        return _("over {share} %", share=99.9)
    return number(100 * share, ".1f" if share > 0.99 else ".0f") + " %"


def _other_image_size(v: _Values) -> str:
    if "speed_mps" not in v:
        return _(
            "the {tracks} tracks fit an image of {width_px} x {height_px} pixels: people walk on "
            "the ground there, at {rescaled_speed_mps:.2f} m/s, but outside it in pixels of the "
            "camera's frame",
            **v,
        )
    return _(
        "the {tracks} tracks fit an image of {width_px} x {height_px} pixels: people walk more "
        "evenly there, at {rescaled_speed_mps:.2f} m/s, than in pixels of the camera's frame, at "
        "{speed_mps:.2f} m/s",
        **v,
    )


def _beyond_before(v: _Values) -> str:
    return _(
        "{numbers}: was beyond {limit}; it ends once a move is unlikely",
        numbers=_numbers(v),
        limit=_limit(v),
    )


def _number(v: _Values) -> str:
    name: str = v["number"]
    return _(_NUMBERS[name])


def _chart(v: _Values) -> str:
    if v["number"] == "times":
        up = v["sign"] > 0
        what = _("all times were too long") if up else _("all times were too short")
    elif v["sign"] > 0:
        what = _("the {number} had gone up", number=_number(v))
    else:
        what = _("the {number} had gone down", number=_number(v))
    return _(
        "the last {parties} walking groups walk as they would if {what} (drift chart: "
        "{statistic:.0f}, alarm at {level:.0f})",
        what=what,
        **v,
    )


def _slow_drift(v: _Values) -> str:
    said = {"number": _number(v), "since": datetime.fromisoformat(v["since"]).astimezone(v["zone"])}
    return _(
        "has drifted slowly by {by_deg:+.1f} deg (sd {sd_deg:.1f}) in {number} since "
        "{since:%Y-%m-%d}, relative to the first map and speeds of its reference "
        "(score {statistic:.0f}, alarm at {level:.0f})",
        **{**v, **said},
    )


def _scale_changed(v: _Values) -> str:
    factor, rate_hz = v["factor"], v["rate_hz"]
    said = {"percent": 100 * (factor - 1), "was_hz": rate_hz * factor, "rate_hz": rate_hz}
    if factor > 1:
        return _(
            "the scale has changed by {percent:+.0f} % and the angles have not: as if {was_hz:.3g} "
            "frames a second were taken for {rate_hz:.3g}, or the camera was raised",
            **said,
        )
    return _(
        "the scale has changed by {percent:+.0f} % and the angles have not: as if {was_hz:.3g} "
        "frames a second were taken for {rate_hz:.3g}, or the camera was lowered",
        **said,
    )


def _lens_changed(v: _Values) -> str:
    return _(
        "a focal length that differs by {percent:+.0f} % explains where people walk, and how fast, "
        "better than any move: the lens was zoomed, or the picture is cut or scaled "
        "otherwise",
        percent=100 * (v["factor"] - 1),
    )


def _ambiguous(v: _Values) -> str:
    said = _(" and ").join(_("{turn:+.1f} deg", turn=turn) for turn in v["turns_deg"])
    return _("turns of {turns} explain where people walk about as well", turns=said)


def _unidentifiable(v: _Values) -> str:
    said = [
        _("{number} (sd {sd:.1f} deg)", number=_(_NUMBERS[name]), sd=v[f"{name}_sd_deg"])
        for name in ("tilt", "roll")
        if f"{name}_sd_deg" in v
    ]
    if "log_height_sd" in v:
        said.append(_("height (sd {percent:.0f} %)", percent=100 * v["log_height_sd"]))
    text = _("the tracks cannot tell {numbers}", numbers=_(" and ").join(said))
    if "alike" in v:
        first, second = (_(_NUMBERS[name]) for name in v["alike"])
        text += ": " + _(
            "people walk too much alike, one way or along one path, and {first} makes up for "
            "{second}",
            first=first,
            second=second,
        )
    return text


def _few_groups(v: _Values) -> str:
    return _n(
        "the {tracks} tracks are of {n} walking group, at least {least_parties} are needed to tell "
        "the camera's drift from theirs",
        "the {tracks} tracks are of {n} walking groups, at least {least_parties} are needed to "
        "tell the camera's drift from theirs",
        v["parties"],
        **v,
    )


def _since(v: _Values) -> str:
    return _(
        "{tracks} tracks {since}; at least {least_walkers} of people who walk for a few seconds "
        "inside the image are needed",
        since=_(_SINCE[Cause(v["cause"])]),
        **v,
    )


def _sure_of_pose(v: _Values) -> str:
    """How sure a proposed pose is: nine cases of ten are within that."""
    return _(
        "sure to {tilt:.1f}° in tilt, {roll:.1f}° in roll, {height:.1f} m in height",
        tilt=Z90 * v["tilt_sd_deg"],
        roll=Z90 * v["roll_sd_deg"],
        height=Z90 * v["height_sd_m"],
    )


def _maintenance(v: _Values) -> str:
    until = _("maintenance is under way until {time}", time=_clock(v["until"], v["zone"]))
    return f"{until} ({v['note']})" if v.get("note") else until


def _clock(at: str, zone: tzinfo) -> str:
    """A time by a zone's clock."""
    return f"{datetime.fromisoformat(at).astimezone(zone):%Y-%m-%d %H:%M}{'Z' * (zone is UTC)}"


def _silent(v: _Values) -> str:
    if "missed_tracks" in v:
        words = _(
            "no track for {silent_s_in_h:.1f} h, where about {missed_tracks:.0f} are usual by now",
            **v,
        )
    else:
        words = _("no track for {silent_s_in_h:.1f} h, as is usual at this hour", **v)
    late = v.get("late_s_in_h")
    if late is None:
        return words
    return f"{words}; {_('its tracks come up to {late:.1f} h late', late=late)}"


def _those_cameras(v: _Values) -> str:
    if v["track_source"]:
        return _("{cameras} cameras of the tracker {track_source!r}", **v)
    return _("{cameras} cameras", **v)


def _moved_together(v: _Values) -> str:
    return _(
        "{which} moved together: the tracker or its clock is the likely cause, rather than each "
        "camera by itself; cameras that hang on one mast or building would look the same",
        which=_those_cameras(v),
    )


def _silent_together(v: _Values) -> str:
    return _(
        "{which} fell silent together: the tracker, its network or its clock is the likely cause, "
        "rather than each camera by itself",
        which=_those_cameras(v),
    )


def _other_sources(v: _Values) -> str:
    return _(
        "tracks of {names} come beside those of {counting!r}, which count: they are kept and move "
        "nothing. Should {counting!r} fall silent for {silent_s_in_h:g} h, they take over once "
        "{wanted} of them were seen while the camera was where it should be; a person can say so "
        "at once",
        names=_(" and ").join(repr(name) for name in v["sources"]),
        **{"counting": None, **v},
    )


def _tracks_skipped(v: _Values) -> str:
    names = ", ".join(repr(name) for name in v["track_ids"])
    if v["tracks"] > len(v["track_ids"]):
        names += _(" and others")
    return _n(
        "{n} of its tracks is not looked at, for a look would take too long of it: {names}",
        "{n} of its tracks are not looked at, for a look would take too long of them: {names}",
        v["tracks"],
        names=names,
    )


# A text takes the values by their names.
_WORDS: dict[StrEnum, str | Callable[[_Values], str]] = {
    TracksCode.BEYOND_LIMITS: lambda v: _(
        "{numbers}, by more than {limit}", numbers=_numbers(v), limit=_limit(v)
    ),
    TracksCode.SUSPECTED: lambda v: _(
        "{numbers}, which is not sure enough for an alert", numbers=_numbers(v)
    ),
    TracksCode.BEYOND_LIMITS_BEFORE: _beyond_before,
    TracksCode.BEYOND_LIMITS_LAST_IDENTIFIABLE: lambda v: _(
        "beyond {limit} when it was last told", limit=_limit(v)
    ),
    TracksCode.WITHIN_LIMITS: _numbers,
    TracksCode.CHART: _chart,
    TracksCode.SLOW_DRIFT: _slow_drift,
    TracksCode.SCALE_CHANGED: _scale_changed,
    TracksCode.LENS_CHANGED: _lens_changed,
    TracksCode.PATHS_CHANGED: N_(
        "people walk on none of the paths that were learned: the camera was turned far, or they "
        "walk elsewhere"
    ),
    TracksCode.WAYS_CHANGED: N_(
        "people walk the same ground other ways than they did: where they do tells no pose"
    ),
    TracksCode.HEADING_AMBIGUOUS: _ambiguous,
    TracksCode.HEADING_UNIDENTIFIABLE: N_(
        "where people walk does not tell the heading (sd {heading_sd_deg:.1f} deg)"
    ),
    TracksCode.UNIDENTIFIABLE: _unidentifiable,
    TracksCode.TOO_FEW_GROUPS: _few_groups,
    TracksCode.SPEED_UNUSUAL: N_(
        "people walk at {speed_mps:.2f} m/s at the prior pose, {slow_mps:g} to {fast_mps:g} m/s "
        "is usual: the prior height or the frame rate is wrong"
    ),
    TracksCode.STATURE_UNUSUAL: N_(
        "boxes say that people are {stature_m:.2f} m tall at the prior pose, {short_m:g} to "
        "{tall_m:g} m is usual: the prior height is wrong"
    ),
    TracksCode.PRIOR_POSE_DOUBTED: N_(
        "the reference tracks put the camera {tilt_deg:+.1f} deg in tilt and {roll_deg:+.1f} deg "
        "in roll from its prior pose: the prior pose is wrong, or the camera had moved before"
    ),
    TracksCode.PIECES: N_(
        "{pieces:g} of {tracks:g} tracks are pieces of others' walks: the tracker loses people, "
        "each of whom counts once"
    ),
    TracksCode.IMAGE_SHARES: N_(
        "no number of the {tracks} tracks is above {largest_px:.2f}: they look like shares of the "
        "image, not pixels"
    ),
    TracksCode.OTHER_IMAGE_SIZE: _other_image_size,
    ServiceCode.AS_SAID: "{text}",
    ServiceCode.NOBODY_POSTED: N_("no track of anybody has been posted for it yet"),
    ServiceCode.POSE_UNKNOWN: N_(
        "its pose is found by the people before it: {tracks} tracks so far, of {least_walkers} or "
        "more that walk"
    ),
    ServiceCode.POSE_UNTOLD: lambda v: _(
        "{tracks} tracks of {groups} people or groups do not tell its pose yet ({sure}); more "
        "people help, and such as walk other ways",
        sure=_sure_of_pose(v),
        **v,
    ),
    ServiceCode.POSE_PROPOSED: lambda v: _(
        "pose estimated from {tracks} tracks ({sure}); an operator has to confirm it",
        sure=_sure_of_pose(v),
        **v,
    ),
    ServiceCode.LEARNING_REFERENCE: N_("the reference is being learned"),
    ServiceCode.REFERENCE_TRACKS: lambda v: (
        _("{counted} of {wanted} people for the reference", **v)
        + (
            "; " + _("{pieces} of {tracks} tracks are pieces of others' walks", **v)
            if v["pieces"]
            else ""
        )
    ),
    ServiceCode.TRACKS_SINCE: _since,
    ServiceCode.LAST_IDENTIFIABLE: N_("when it was last told:"),
    ServiceCode.MAINTENANCE: _maintenance,
    ServiceCode.WITHOUT_PART: lambda v: _(
        "without the {part}: {why}", part=v["part"].replace("_", " "), why=v["why"]
    ),
    ServiceCode.AWAITING_IMAGE: lambda v: _n(
        "{n} image was compared; the next that matches shows where the camera is",
        "{n} images were compared; the next that matches shows where the camera is",
        int(v["compared"]),
    ),
    ServiceCode.BY_PICTURE: lambda v: _(
        "estimated from the image of {taken_at}, without tracks since",
        taken_at=_clock(v["taken_at"], v["zone"]),
    ),
    TracksCode.SITE_CHANGED: N_(
        "the picture says that it stands, and people walk elsewhere: the site changed"
    ),
    ServiceCode.PICTURE_SHIFTED: N_(
        "near and far things moved apart in the picture: the camera was moved aside, too, and how "
        "far it turned is known less well"
    ),
    ServiceCode.PICTURE_FROZEN: N_("the same picture for {unchanged_s_in_h:.1f} h"),
    ServiceCode.PICTURE_BLACK: N_("its picture is black"),
    ServiceCode.PICTURE_BLINDED: N_("it is blinded: far more of its picture is white than ever"),
    ServiceCode.PICTURE_COVERED: N_("something covers its view"),
    ServiceCode.PICTURE_DEFOCUSED: N_("its picture is out of focus"),
    ServiceCode.PICTURE_UPSIDE_DOWN: N_("its picture is upside down"),
    ServiceCode.PICTURE_OTHER_SCENE: N_("its picture is of another scene: covered, or turned far"),
    ServiceCode.SILENT_USUAL: _silent,
    ServiceCode.SILENT_UNUSUAL: _silent,
    ServiceCode.SILENT_UNKNOWN: N_(
        "the newest track ended {silent_s_in_h:.1f} h ago; up to {limit_s_in_h:g} h are waited for"
    ),
    ServiceCode.MOVED_TOGETHER: _moved_together,
    ServiceCode.FELL_SILENT_TOGETHER: _silent_together,
    ServiceCode.OTHER_SOURCES: _other_sources,
    ServiceCode.LOOKS_FAIL: N_(
        "its tracks cannot be looked at: {tries} tries failed in a row, the last with {error}"
    ),
    ServiceCode.TRACKS_WAIT: lambda v: _(
        "its tracks have waited for {waits:.0f} min; up to {limit:g} min are waited for",
        waits=v["waits_s"] / 60,
        limit=v["limit_s"] / 60,
    ),
    ServiceCode.TRACKS_SKIPPED: _tracks_skipped,
    ServiceCode.BRIDGE_SILENT: lambda v: _(
        "the MQTT bridge {bridge} has not reported for {minutes:.0f} min: tracks that it carries "
        "do not arrive",
        minutes=v["silent_s"] / 60,
        **v,
    ),
    ServiceCode.BRIDGE_RESTARTS: lambda v: _(
        "the MQTT bridge {bridge} was started {starts} times within {minutes:.0f} min",
        minutes=v["within_s"] / 60,
        **v,
    ),
    ServiceCode.BRIDGE_ENDS: N_("the MQTT bridge {bridge} does not keep running: {error}"),
    ServiceCode.DISABLED_BY_PERSON: N_("disabled by a person"),
    ServiceCode.ENDPOINT_GONE: N_("it answered 410: it is gone for good"),
    ServiceCode.ENDPOINT_FAILS: N_("it failed for more than {patience_s_in_h:g} h: {error}"),
    ServiceCode.SECRET_LOST: N_(
        "its secret was lost with the key: fetch a new one, tell the receiver, enable it"
    ),
}
