"""The question about the image size of tracks, and its answers, in words."""

from collections.abc import Mapping
from typing import Any

from models.reasons import Reason, TracksCode
from service.wording.language import _
from service.wording.reasons import in_words


def question_words(reason: Reason) -> str:
    """The question that a doubt about the image size of tracks asks, with its evidence."""
    if reason.code == TracksCode.IMAGE_SHARES:
        asked = _("Are the tracks in shares of the image?")
    else:
        size = _size(reason.values["width_px"], reason.values["height_px"])
        asked = _("Are the tracks in pixels of a {size} image?", size=size)
    why = in_words((reason,))
    wait = _("Nothing is learned from them until you answer.")
    return f"{asked} {why[:1].upper()}{why[1:]}. {wait}"


def fix_words(fix: Mapping[str, Any]) -> str:
    """The label of a button that rescales tracks."""
    if "tracks_size" not in fix:
        return _("Yes, rescale from shares")
    return _("Yes, rescale from {size}", size=_size(*fix["tracks_size"]))


def keep_words(keep: Mapping[str, Any]) -> str:
    """The label of the button that confirms pixels of the frame."""
    return _("No, keep {size} pixels", size=_size(*keep["tracks_size"]))


def _size(width: Any, height: Any) -> str:
    return _("{width} x {height}", width=width, height=height)
