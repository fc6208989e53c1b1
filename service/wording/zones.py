"""Zones in words: how much of one still lies where it was drawn, how much the picture shows."""

from collections.abc import Mapping
from typing import Any

from models.quantiles import Z90
from service.enums import ZoneOn

_APPLIED = {
    "frigate": (
        "Have them in place of this camera's in Frigate's configuration, and restart Frigate."
    ),
    "axis": "Have the camera take them by setConfiguration.",
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
        return "none of it is in the picture any more"
    where = "on the ground" if on == ZoneOn.GROUND else "of it"
    if overlap >= _MANY:
        words = "all still lies where it was drawn"
    elif overlap < 1 - _MANY:
        words = "nothing lies where it was drawn"
    else:
        words = f"{100 * overlap:.0f} % {where} still lies where it was drawn"
    if in_view < _MANY:
        words += f", {100 * (1 - in_view):.0f} % has left the picture"
    return words


def count_words(crossed: int | None, missed: int | None, false_counts: int | None) -> str:
    """The people of a line as it was drawn, in words; nothing of an area or of nobody."""
    said = []
    if crossed:
        whom = "none" if missed == 0 else "all" if missed == crossed else str(missed)
        were = "was" if missed == 1 else "were"
        said.append(f"of the last {crossed} who crossed it, {whom} {were} missed")
    if false_counts:
        were = "was" if false_counts == 1 else "were"
        said.append(f"{false_counts} {were} counted who did not cross it")
    return ", ".join(said)


def moved_zone_words(moved: Mapping[str, Any]) -> str:
    """A zone of a camera that moved, as of an alert's evidence, to follow its name and a colon."""
    words = zone_words(ZoneOn(moved["on"]), overlap=moved["overlap"], in_view=moved["in_view"])
    counted = count_words(moved["crossed"], moved["missed"], moved["false_counts"])
    return f"{words}; {counted}" if counted else words


def apply_words(form: str | None) -> str:
    """How zones that are mended come to count in the system that they are of, in a sentence."""
    return _APPLIED.get(form or "", "Have them in place of those that were drawn.")


def corner_words(worst_px: float | None) -> str:
    """How sure mended corners are, by the major semi-axis of the least sure one; maybe nothing."""
    if worst_px is None:
        return ""
    return f"mended corners are sure to ±{max(Z90 * worst_px, 1):.0f} px"
