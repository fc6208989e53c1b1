"""Depth limit of documents: parsers, copies and writers recurse once per level."""

from typing import Any

MAX_LEVELS = 32  # a Frigate configuration has 7 levels, GeoJSON zones have 6


def check_levels(value: Any) -> None:
    """Check the depth of a parsed document of lists and dicts, without recursion.

    Raises:
        ValueError: lists and dicts are nested more than `MAX_LEVELS` deep.
    """
    level = [value]
    for _ in range(MAX_LEVELS):
        level = [child for each in level for child in _children(each)]
        if not level:
            return
    raise too_deep()


def too_deep() -> ValueError:
    """The error for a document of too many levels."""
    return ValueError(f"at most {MAX_LEVELS} nested levels are accepted, got more")


def _children(value: Any) -> list[Any]:
    values = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [each for each in values if isinstance(each, dict | list)]
