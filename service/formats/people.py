"""Who is a person, by the class that a tracker gives."""

from typing import Any

# Of detectors trained on COCO, BoxMOT's among them.
COCO_PEOPLE = frozenset((0.0,))
_NAMES = frozenset(
    ("person", "people", "pedestrian", "human", "walker", "man", "woman", "child", "adult")
)


class NoPersonError(Exception):
    """A track is of something that does not walk, as its class says."""


def check_person(value: Any) -> None:
    """Pass silently if a class is of a person, by English name or COCO's number, or not given.

    Raises:
        NoPersonError: it is of something else.
        ValueError: it is neither text nor a number.
    """
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"class: text or a number is needed, got {value!r:.60}")
    if not (value.strip().lower() in _NAMES if isinstance(value, str) else value in COCO_PEOPLE):
        raise NoPersonError
