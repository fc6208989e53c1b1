"""Depth limit of documents: parsers, copies and writers recurse once per level."""

import re
from itertools import accumulate
from typing import Any

# Of every format. A Frigate configuration has 7 levels, ONVIF in a SOAP envelope 16.
MAX_LEVELS = 32

# The closing quote is optional: text that ends within a string is scanned once, not once a quote.
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?', re.DOTALL)
_STEPS = {ord("["): 1, ord("{"): 1, ord("]"): -1, ord("}"): -1}
_OTHERS = bytes(sorted(set(range(256)) - _STEPS.keys()))


def json_levels(text: bytes) -> int:
    """Return how many arrays and objects enclose the deepest value of JSON text.

    The text need not be valid. Text with few brackets is not scanned: the result is then an upper
    bound of at most `MAX_LEVELS`.
    """
    opening = text.count(b"[") + text.count(b"{")
    if opening <= MAX_LEVELS:
        return opening
    brackets = _STRING.sub(b"", text).translate(None, _OTHERS)
    return max(accumulate(map(_STEPS.__getitem__, brackets)), default=0)


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
