"""Large JSON bodies, track by track: one call for all of it would stop every other thread."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from service.errors import TooLargeError

_SMALL = 1024 * 1024  # bytes that are read in one go, in some ten milliseconds
_MOST_OTHER = 1024 * 1024  # characters of what is no track
MAX_TRACK_CHARS = 2 * 1024 * 1024  # more than the most points of a track need
_SPACE = re.compile(r"[ \t\n\r]*")
_STRUCTURE = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}]', re.DOTALL)
_PLAIN = re.compile(r'"(?:[^"\\]|\\.)*"|[^\s,\[\]{}"]+', re.DOTALL)
_ENDS = {"{": 1, "[": 1, "}": -1, "]": -1}


@dataclass(frozen=True, slots=True, kw_only=True)
class OversizedTrack:
    """Stands for a track that is too long to be read."""

    characters: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackTexts:
    """The tracks of a body, each read when its turn comes."""

    text: str
    spans: tuple[tuple[int, int], ...]

    def __len__(self) -> int:
        return len(self.spans)

    def __iter__(self) -> Iterator[Any]:
        for begin, end in self.spans:
            if end - begin > MAX_TRACK_CHARS:
                yield OversizedTrack(characters=end - begin)
            else:
                yield json.loads(self.text[begin:end])


def read_document(body: bytes) -> Any:
    """The JSON value of a body; of a large object, `tracks` are a `TrackTexts`.

    Raises:
        ValueError: it is no JSON. Of `TrackTexts` each track may raise it, too.
        RecursionError: it is nested too deeply.
        TooLargeError: something other than tracks is large.
    """
    if len(body) <= _SMALL:
        return json.loads(body)
    text = body.decode(json.detect_encoding(body))
    document: dict[str, Any] = {}
    at = _symbol(text, 0, "{")
    while text[at : at + 1] != "}":
        end = _end(text, at)
        name = json.loads(text[at:end])
        if not isinstance(name, str):
            raise ValueError(f"a name is needed at {at}")
        at = _symbol(text, end, ":")
        if name == "tracks" and text[at : at + 1] == "[":
            spans, at = _spans(text, at)
            document[name] = TrackTexts(text=text, spans=spans)
        else:
            end = _end(text, at)
            if end - at > _MOST_OTHER:
                raise TooLargeError(
                    f"{name:.40}: at most {_MOST_OTHER} characters are taken, got {end - at}"
                )
            document[name] = json.loads(text[at:end])
            at = _space(text, end)
        at = _next(text, at, "}")
    if _space(text, at + 1) != len(text):
        raise ValueError(f"nothing more is needed from {at + 1} on")
    return document


def _spans(text: str, at: int) -> tuple[tuple[tuple[int, int], ...], int]:
    """Where the items of the list that begins at a place are, and the place after the list."""
    spans = []
    at = _symbol(text, at, "[")
    while text[at : at + 1] != "]":
        end = _end(text, at)
        spans.append((at, end))
        at = _next(text, _space(text, end), "]")
    return tuple(spans), _space(text, at + 1)


def _end(text: str, at: int) -> int:
    """The place after the value that begins at a place."""
    if text[at : at + 1] not in ("{", "["):
        plain = _PLAIN.match(text, at)
        if plain is None:
            raise ValueError(f"a value is needed at {at}")
        return plain.end()
    if text[at] == "{":
        # Most tracks hold no other object, and no text with a brace in it.
        end = text.find("}", at) + 1
        if (
            end
            and text.count("{", at, end) == 1
            and text.count('"', at, end) % 2 == 0
            and text.find("\\", at, end) < 0
        ):
            return end
    depth = 0
    for found in _STRUCTURE.finditer(text, at):
        depth += _ENDS.get(found[0], 0)
        if not depth:
            return found.end()
    raise ValueError(f"what begins at {at} has no end")


def _space(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    assert found is not None
    return found.end()


def _symbol(text: str, at: int, symbol: str) -> int:
    """The next place that is not space after a symbol, which must come."""
    at = _space(text, at)
    if text[at : at + 1] != symbol:
        raise ValueError(f"{symbol!r} is needed at {at}")
    return _space(text, at + 1)


def _next(text: str, at: int, end: str) -> int:
    """The place of the next item, or of the symbol that ends all of them."""
    if text[at : at + 1] == end:
        return at
    at = _symbol(text, at, ",")
    if text[at : at + 1] == end:
        raise ValueError(f"a value is needed at {at}")
    return at
