"""The service's own reasons, beside those of the tracks, and all of them as JSON."""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

from models.reasons import Reason, TracksCode
from service.degrees import in_degrees

# Of one thing, in the order in which they are said.
Reasons = tuple[Reason, ...]


class ServiceCode(StrEnum):
    """Codes of the service's own reasons. They are kept by clients and in stores: they stay."""

    AS_SAID = "as_said"
    NOBODY_POSTED = "nobody_posted"
    POSE_UNKNOWN = "pose_unknown"
    POSE_UNTOLD = "pose_untold"
    POSE_PROPOSED = "pose_proposed"
    LEARNING_REFERENCE = "learning_reference"
    REFERENCE_TRACKS = "reference_tracks"
    TRACKS_SINCE = "tracks_since"
    LAST_IDENTIFIABLE = "last_told"
    MAINTENANCE = "maintenance"
    WITHOUT_PART = "without_part"
    SILENT_USUAL = "silent_usual"
    SILENT_UNUSUAL = "silent_unusual"
    SILENT_UNKNOWN = "silent_unknown"
    MOVED_TOGETHER = "moved_together"
    FELL_SILENT_TOGETHER = "fell_silent_together"
    OTHER_SOURCES = "other_sources"
    LOOKS_FAIL = "looks_fail"
    TRACKS_WAIT = "tracks_wait"
    TRACKS_SKIPPED = "tracks_skipped"
    BY_PICTURE = "by_picture"
    AWAITING_IMAGE = "awaiting_image"
    PICTURE_SHIFTED = "picture_shifted"
    PICTURE_FROZEN = "picture_frozen"
    PICTURE_BLACK = "picture_black"
    PICTURE_BLINDED = "picture_blinded"
    PICTURE_COVERED = "picture_covered"
    PICTURE_DEFOCUSED = "picture_defocused"
    PICTURE_UPSIDE_DOWN = "picture_upside_down"
    PICTURE_OTHER_SCENE = "picture_other_scene"
    BRIDGE_SILENT = "bridge_silent"
    BRIDGE_RESTARTS = "bridge_restarts"
    BRIDGE_ENDS = "bridge_ends"
    DISABLED_BY_PERSON = "disabled_by_person"
    ENDPOINT_GONE = "endpoint_gone"
    ENDPOINT_FAILS = "endpoint_fails"
    SECRET_LOST = "secret_lost"


_CODES: dict[str, StrEnum] = {
    str(code): code for each in (TracksCode, ServiceCode) for code in each
}
CODES = tuple(_CODES)


def as_said(text: str) -> Reasons:
    """A sentence that has no code of its own."""
    return (Reason(code=ServiceCode.AS_SAID, values={"text": text}),)


def some(*reasons: Reason | None) -> Reasons:
    """Those that there are."""
    return tuple(reason for reason in reasons if reason is not None)


def code_of(reasons: Sequence[Reason]) -> str | None:
    """The code of the first; None where there is none."""
    return str(reasons[0].code) if reasons else None


def values_of(reasons: Sequence[Reason]) -> dict[str, Any]:
    """The numbers and names of the first for clients, who take angles in degrees."""
    return in_degrees(reasons[0].values) if reasons else {}


def to_json(reasons: Sequence[Reason]) -> list[dict[str, Any]]:
    """Reasons as a store keeps them."""
    return [{"code": str(each.code), "values": dict(each.values)} for each in reasons]


def from_json(kept: Sequence[Mapping[str, Any]]) -> Reasons:
    """The reasons of `to_json`.

    Raises:
        KeyError: a code that is none.
    """
    return tuple(Reason(code=_CODES[each["code"]], values=each["values"]) for each in kept)
