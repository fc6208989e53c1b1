"""How deeply JSON text is nested, measured before any parser recurses into it."""

import re
from itertools import accumulate

MAX_LEVELS = 32  # of every format; the deepest real message, ONVIF in a SOAP envelope, has 16

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
