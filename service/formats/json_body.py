"""Large JSON bodies: only what is looked for is built, however much else there is.

`json.loads` builds up to 80 bytes for one of a body, and stops every other thread meanwhile.
"""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import msgspec
from msgspec import UNSET, Raw, UnsetType

from service.errors import MalformedError, TooLargeError
from service.formats.track import MAX_TRACKS

_SMALL = 1024 * 1024  # bytes that are read in one go, in some ten milliseconds
_PART = 1024 * 1024  # bytes that are replaced in one go
_MOST_OTHER = 4096  # bytes of a field that is not the tracks
MAX_TRACK_BYTES = 2 * 1024 * 1024  # more than the most points of a track need
# JSON has neither, but Python's writers do: a track with one is refused, and no other. While such a
# body is taken apart, a number that no float holds stands for it.
_STAND_INS = ((b"NaN", b"9e991"), (b"Infinity", b"9e992"))
_MOST_GROWTH = 8 * 1024 * 1024  # bytes by which they may be longer: rows of a time and two add 5
_ABSENT = Raw(b"")
_SMALL_FIELDS = ("source", "frame_rate_hz", "started_at", "size", "normalised")
DOCUMENT_FIELDS = frozenset((*_SMALL_FIELDS, "tracks"))
_raw = partial(msgspec.field, default=_ABSENT)
# An array that is read into a struct is skipped from where the struct ends; that of a list is not.
_Tracks = msgspec.defstruct(
    "_Tracks", [(f"at_{n}", Raw, _ABSENT) for n in range(MAX_TRACKS + 1)], array_like=True
)
_Rows = list[tuple[float, ...]] | UnsetType
_Kind = TypeVar("_Kind")
_UNKNOWN = re.compile(r"^Object contains unknown field `(.*)`$", re.DOTALL)
_PLACE = re.compile(r" - at `\$\.?(.*)`$")


class _Document(msgspec.Struct):
    """A body as it is taken apart: the text of each field."""

    tracks: _Tracks | None = None  # type: ignore[valid-type]
    source: Raw = _raw()
    frame_rate_hz: Raw = _raw()
    started_at: Raw = _raw()
    size: Raw = _raw()
    normalised: Raw = _raw()


class _KnownDocument(_Document, forbid_unknown_fields=True):
    pass


class _Named(msgspec.Struct):
    id: str | int | None = None


class _Track(_Named, gc=False):
    kind: str | float | bool | None = msgspec.field(name="class", default=None)
    points: _Rows = UNSET
    boxes: _Rows = UNSET
    frames: _Rows = UNSET
    frame_boxes: _Rows = UNSET
    size: tuple[float, float] | None = None
    normalised: bool | None = None
    confidence: str | float | None = None


class _KnownTrack(_Track, gc=False, forbid_unknown_fields=True):
    pass


_FORMS = ("points", "boxes", "frames", "frame_boxes")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnreadableTrack:
    """Stands for a track that is no such thing, or too long to be read."""

    id: str | int | None
    code: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackTexts:
    """The tracks of a body, each read when its turn comes; one more than may be, of too many."""

    texts: tuple[Raw, ...]
    stand_ins: bool

    def __len__(self) -> int:
        return len(self.texts)

    def __iter__(self) -> Iterator[Any]:
        return (read_track_text(text, stand_ins=self.stand_ins) for text in self.texts)


def read_document(body: bytes) -> Any:
    """The JSON value of a body; of a large object its known fields, `tracks` as a `TrackTexts`.

    Of the unknown fields of a large object the first is there, too, without its value.

    Raises:
        ValueError: it is no JSON. Of `TrackTexts` each track may raise it, too.
        RecursionError: it is nested too deeply.
        TooLargeError: something other than tracks is large.
        MalformedError: a large body that is no object, or has no list of tracks.
    """
    if not is_large(body):
        return json.loads(body)
    body = _as_utf8(body)
    try:
        return _document(body, stand_ins=False)
    except ValueError:
        replaced = _with_stand_ins(body)
        if replaced is None:
            raise
    return _document(replaced, stand_ins=True)


def is_large(body: bytes) -> bool:
    """True of a body that is taken apart before it is read."""
    return len(body) > _SMALL


def read_line(line: bytes) -> Any:
    """The value of a track that is a line of a large body, as of `read_track_text`.

    Raises:
        ValueError: it is no JSON.
        RecursionError: it is nested too deeply.
    """
    line = _as_utf8(line)
    try:
        return read_track_text(line)
    except ValueError:
        replaced = _with_stand_ins(line)
        if replaced is None:
            raise
    return read_track_text(replaced, stand_ins=True)


def read_track_text(text: bytes | Raw, *, stand_ins: bool = False) -> Any:
    """The value of a track in a large body, or what stands for one that cannot be read.

    Raises:
        ValueError: it is no JSON.
        RecursionError: it is nested too deeply.
    """
    size = len(memoryview(text))
    if size > MAX_TRACK_BYTES:
        words = f"a track of at most {MAX_TRACK_BYTES} bytes is taken, got {size}"
        name = _name_of(text, stand_ins=stand_ins)
        return UnreadableTrack(id=name, code="too_many_points", detail=words)
    try:
        track, unknown = _decode_naming(text, _KnownTrack, _Track)
    except msgspec.ValidationError as error:
        return _unreadable(_name_of(text, stand_ins=stand_ins), str(error))
    rows = {form: found for form in _FORMS if (found := getattr(track, form)) is not UNSET}
    given = {
        "size": track.size,
        "normalised": track.normalised,
        "confidence": track.confidence,
    }
    name = _as_given(track.id, stand_ins=stand_ins)
    return {"id": name, "class": track.kind, **given, **rows, **unknown}


def _name_of(text: bytes | Raw, *, stand_ins: bool) -> str | int | None:
    """The id of a track of which nothing else can be read; None where not even that."""
    try:
        return _as_given(_decode(text, _Named).id, stand_ins=stand_ins)
    except msgspec.ValidationError:
        return None


def _as_given(name: str | int | None, *, stand_ins: bool) -> str | int | None:
    if isinstance(name, str) and stand_ins:
        return _with_words(name.encode()).decode()
    return name


def _decode(text: bytes | Raw, kind: type[_Kind]) -> _Kind:
    try:
        return msgspec.json.decode(text, type=kind)
    except msgspec.ValidationError:
        raise
    except msgspec.DecodeError as error:
        raise ValueError(str(error)) from error


def _decode_naming(
    text: bytes | Raw, strict: type[_Kind], lenient: type[_Kind]
) -> tuple[_Kind, dict[str, Any]]:
    """What a text says, and the first field of it that is unknown, without what it says."""
    try:
        return _decode(text, strict), {}
    except msgspec.ValidationError as error:
        found = _UNKNOWN.match(str(error))
        if found is None:
            raise
        return _decode(text, lenient), {found[1]: None}


def _unreadable(name: str | int | None, words: str) -> UnreadableTrack:
    """What stands for a track of which msgspec says: "Expected `x`, got `y` - at `$.place[0]`"."""
    found = _PLACE.search(words)
    place = re.sub(r"\[(\d+)\]", r"/\1", found[1]) if found else "track"
    not_finite = "out of range" in words or "`float`, got `null`" in words
    return UnreadableTrack(
        id=name,
        code="not_finite" if not_finite else "malformed",
        detail=f"{place}: {_PLACE.sub('', words)}",
    )


def _document(body: bytes, *, stand_ins: bool) -> dict[str, Any]:
    try:
        found, document = _decode_naming(body, _KnownDocument, _Document)
    except msgspec.ValidationError as error:
        if "$.tracks" not in str(error):
            return {}
        raise MalformedError.of_field("tracks", "a list of tracks is needed") from error
    for name in _SMALL_FIELDS:
        raw = memoryview(getattr(found, name))
        if len(raw) > _MOST_OTHER:
            raise TooLargeError(f"{name}: at most {_MOST_OTHER} bytes are taken, got {len(raw)}")
        if raw:
            text = bytes(raw)
            document[name] = json.loads(_with_words(text) if stand_ins else text)
    if found.tracks is not None:
        texts = msgspec.structs.astuple(found.tracks)
        count = next((n for n, text in enumerate(texts) if text is _ABSENT), len(texts))
        document["tracks"] = TrackTexts(texts=texts[:count], stand_ins=stand_ins)
    return document


def _as_utf8(text: bytes) -> bytes:
    """A text in the encoding that msgspec reads, without a mark of its order of bytes."""
    encoding = json.detect_encoding(text)
    return text if encoding == "utf-8" else text.decode(encoding).encode()


def _with_stand_ins(body: bytes) -> bytes | None:
    """A body with numbers for its words; None where it has none, or too many, or such a number.

    A part is replaced at a time, so that other threads have a turn.
    """
    if any(number in body for _, number in _STAND_INS):
        return None
    parts, begin = [], 0
    while begin < len(body):
        comma = body.find(b",", begin + _PART)
        end = len(body) if comma < 0 else comma
        part = body[begin:end]
        for word, number in _STAND_INS:
            part = part.replace(word, number)
        parts.append(part)
        begin = end
    replaced = b"".join(parts)
    many = len(replaced) - len(body) > _MOST_GROWTH
    return None if many or replaced == body else replaced


def _with_words(text: bytes) -> bytes:
    for word, number in _STAND_INS:
        text = text.replace(number, word)
    return text
