"""Zones in words: how much of one still lies where it was drawn, how much the picture shows."""

from collections.abc import Collection, Mapping
from typing import Any

from models.quantiles import Z90
from service.enums import ZoneOn
from service.wording.language import N_, _, _n
from service.wording.moves import NAMES

_APPLIED = {
    "frigate": N_(
        "Have them in place of this camera's in Frigate's configuration, and restart Frigate."
    ),
    "axis": N_("Have the camera take them by setConfiguration."),
}
_MANY = 0.995  # of a share that is told as whole


def zone_words(on: ZoneOn, *, overlap: float, in_view: float) -> str:
    """A zone of a camera that moved, to follow its name and a colon.

    Args:
        on: what it lies on.
        overlap: the share that still lies where it was drawn.
        in_view: the share of it that the picture shows.
    """
    if in_view <= 0:
        return _("none of it is in the picture any more")
    share = f"{100 * overlap:.0f}"
    if overlap >= _MANY:
        words = _("all still lies where it was drawn")
    elif overlap < 1 - _MANY:
        words = _("nothing lies where it was drawn")
    elif on == ZoneOn.GROUND:
        words = _("{share} % on the ground still lies where it was drawn", share=share)
    else:
        words = _("{share} % of it still lies where it was drawn", share=share)
    if in_view < _MANY:
        gone = f"{100 * (1 - in_view):.0f}"
        words += ", " + _("{share} % has left the picture", share=gone)
    return words


def count_words(crossed: int | None, missed: int | None, false_counts: int | None) -> str:
    """The people of a line as it was drawn, in words; nothing of an area or of nobody."""
    said = []
    if crossed:
        if missed == 0:
            said.append(_("of the last {all} who crossed it, none were missed", all=crossed))
        elif missed == crossed and missed != 1:
            said.append(_("of the last {all} who crossed it, all were missed", all=crossed))
        else:
            said.append(
                _n(
                    "of the last {all} who crossed it, {n} was missed",
                    "of the last {all} who crossed it, {n} were missed",
                    missed or 0,
                    all=crossed,
                )
            )
    if false_counts:
        said.append(
            _n(
                "{n} was counted who did not cross it",
                "{n} were counted who did not cross it",
                false_counts,
            )
        )
    return ", ".join(said)


def moved_zone_words(moved: Mapping[str, Any]) -> str:
    """A zone of a camera that moved, as of an alert's evidence, to follow its name and a colon."""
    words = zone_words(ZoneOn(moved["on"]), overlap=moved["overlap"], in_view=moved["in_view"])
    counted = count_words(moved["crossed"], moved["missed"], moved["false_counts"])
    return f"{words}; {counted}" if counted else words


def apply_words(form: str | None) -> str:
    """How zones that are mended come to count in the system that they are of, in a sentence."""
    return _(_APPLIED.get(form or "", N_("Have them in place of those that were drawn.")))


def corner_words(worst_px: float | None) -> str:
    """The 90 % error of a zone's corners, by the major semi-axis of the worst one; maybe empty."""
    if worst_px is None:
        return ""
    return _("corners within ±{px:.0f} px (90 %)", px=max(Z90 * worst_px, 1.0))


def undetermined_words(identifiable: Collection[str]) -> str:
    """What the zones of a camera that moved do not follow, in a sentence; empty if they do all."""
    open_ = [_(name) for parameter, name in NAMES.items() if parameter not in identifiable]
    if not open_:
        return ""
    if len(open_) == len(NAMES):
        return _(
            "The camera has moved, and the tracks do not determine its new pose: the zones are "
            "shown as drawn, and may be off by the ± of each."
        )
    return _(
        "The tracks do not determine {names}: if that changed too, the zones do not follow it and "
        "are off by up to the ± of each.",
        names=_(" and ").join(open_),
    )
