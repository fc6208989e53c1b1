"""What adapters hand on: detections, ends and whole tracks, or the reason why there is none."""

import math
from array import array
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple, TypeAlias, TypeVar

import msgspec

from surefoot.nesting import MAX_LEVELS, json_levels
from surefoot.people import PEDESTRIANS, is_ignored
from surefoot.times import LAST_S, not_seconds

Box: TypeAlias = tuple[float, float, float, float]

MAX_MESSAGE_BYTES = 1024 * 1024  # of one message of one source: 64 Frigate paths of an hour
MAX_TEXT = 200  # characters of an id or a camera's name, as the service takes them
MAX_DETAIL = 500  # characters
NORMALISED = (1.0, 1.0)
_FARTHEST = 1e9


class MessageError(Exception):
    """A message that is not what its source's format says; `code` is stable, `detail` for people.

    Codes: `too_large`, `too_deep`, `malformed`, `not_finite`, `unsupported`.
    """

    def __init__(self, code: str, detail: str) -> None:
        self.code = code
        self.detail = detail[:MAX_DETAIL]
        super().__init__(self.detail)


class Detection(msgspec.Struct, frozen=True, array_like=True, tag="seen"):
    """One object in one frame: its box (x1, y1, x2, y2), y down, in a picture of that size.

    `size` is (width, height) in pixels that count from 0 at the centre of the first, `NORMALISED`
    where numbers are shares of the picture, None where the source does not say. `time_s` is since
    the Unix epoch by the source's clock. `label` is the class, a name or a number as text.
    `confidence` 0 marks a detection to be ignored.
    """

    camera: str
    time_s: float
    track_id: str
    label: str | None
    box: Box
    size: tuple[float, float] | None
    confidence: float | None = None


class Ended(msgspec.Struct, frozen=True, array_like=True, tag="ended"):
    """Word of a source that an object will not be seen again, or not by this id."""

    camera: str
    track_id: str


class SkippedRow(NamedTuple):
    """A row of a message that could not be read, and why; the message's other rows were."""

    code: str
    detail: str


class WholeTrack(NamedTuple):
    """A track from its first to its last point, ready to be posted.

    `rows` are flat, row after row: of `points` time, u, v of the foot; of `boxes` time and box.
    Tracks of other classes, and those with `confidence` 0, are posted as well: the service decides
    by the same rule for every source, and counts what it skips.
    """

    camera: str
    track_id: str
    label: str | None
    form: str
    rows: "array[float]"
    size: tuple[float, float] | None
    confidence: float | None = None

    @property
    def columns(self) -> int:
        """Numbers of a row."""
        return 5 if self.form == "boxes" else 3

    def to_json(self) -> bytes:
        """Return the track as in a body of `POST /cameras/{id}/tracks`."""
        step = self.columns
        rows = [self.rows[at : at + step].tolist() for at in range(0, len(self.rows), step)]
        track: dict[str, Any] = {"id": self.track_id, self.form: rows}
        if self.label is not None:
            track["class"] = self.label
        if self.confidence is not None:
            track["confidence"] = self.confidence
        return msgspec.json.encode(track)

    def head(self, source: str) -> bytes:
        """What a body says of all its tracks, as JSON: tracks of one head go in one post."""
        head: dict[str, Any] = {"source": source}
        if self.size == NORMALISED:
            head["normalised"] = True
        elif self.size is not None:
            head["size"] = self.size
        return msgspec.json.encode(head)


Found: TypeAlias = Detection | Ended | WholeTrack | SkippedRow
_Row = TypeVar("_Row")


def body_of(head: bytes, tracks: Sequence[bytes]) -> bytes:
    """The body of a post of tracks of one camera and one head."""
    return b'%s,"tracks":[%s]}' % (head[:-1], b",".join(tracks))


def number(value: Any, what: str) -> float:
    """A finite number of a message; text of one, as XML and some JSON have it, counts.

    Raises:
        MessageError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise MessageError("malformed", f"{what}: a number is needed, got {value!r:.40}")
    try:
        found = float(value)
    except (ValueError, OverflowError) as error:
        raise MessageError("malformed", f"{what}: a number is needed, got {value!r:.40}") from error
    if not math.isfinite(found) or abs(found) > 1e3 * _FARTHEST:
        raise MessageError("not_finite", f"{what}: a finite number is needed, got {value!r:.40}")
    return found


def label_of(value: Any, what: str) -> str | None:
    """Return the class of a detection as text, None if the source gives none.

    A number that means a person, as the service reads it, becomes `person`.

    Raises:
        MessageError: it is neither text nor a number.
    """
    if value is None or isinstance(value, str) and not value.strip():
        return None
    label = f"{value:g}" if isinstance(value, float) else text(value, what)
    is_number = label.strip().lstrip("-").replace(".", "", 1).isdecimal()
    return "person" if is_number and PEDESTRIANS.include(label) else label


def confidence_of(value: Any) -> float | None:
    """Return 0 for a detection that is marked to be ignored, None for any other."""
    return 0.0 if is_ignored(value) else None


def text(value: Any, what: str) -> str:
    """A name or an id of a message, as text.

    Raises:
        MessageError: it is neither text of 1 to 200 characters nor a whole number.
    """
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise MessageError("malformed", f"{what}: text is needed, got {value!r:.40}")
    if isinstance(value, int) and abs(value) > 2**64:
        raise MessageError("malformed", f"{what}: a whole number of 64 bits at most is needed")
    found = str(value)
    if not 1 <= len(found) <= MAX_TEXT or "\0" in found or not _is_whole(found):
        raise MessageError(
            "malformed",
            f"{what}: 1 to {MAX_TEXT} characters are needed, got {len(found)}: {found!r:.40}",
        )
    return found


def seconds(value: Any, what: str) -> float:
    """Return a time in seconds since the Unix epoch.

    Raises:
        MessageError: it is no number, or looks like milliseconds.
    """
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if LAST_S < found < math.inf:
        raise MessageError("malformed", f"{what}: {not_seconds(found)}")
    return number(value, what)


def moment(value: Any, what: str) -> float:
    """Seconds since the Unix epoch of an ISO 8601 time; many cameras leave out its zone, UTC.

    Raises:
        MessageError: it is no time of 1970 to 9998.
    """
    try:
        found = datetime.fromisoformat(value)
        if 1970 <= found.year <= 9998:
            return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except (TypeError, ValueError) as error:
        raise MessageError("malformed", f"{what}: a time is needed, got {value!r:.60}") from error
    raise MessageError("malformed", f"{what}: a time from 1970 on is needed, got {value!r:.60}")


def parsed_json(message: bytes) -> Any:
    """The value of a JSON message.

    Raises:
        MessageError: it is too large, or none.
    """
    check_json(message)
    try:
        return msgspec.json.decode(message)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise MessageError("malformed", f"no JSON: {error}") from error


def listed(value: Any, what: str) -> list[Any]:
    """A list of a message; nothing at all counts as an empty one.

    Raises:
        MessageError: it is something else.
    """
    if value is None:
        return []
    if not isinstance(value, list):
        raise MessageError("malformed", f"{what}: a list is needed, got {value!r:.40}")
    return value


def box_of(edges: Sequence[float], what: str) -> Box:
    """The box with these edges (x1, y1, x2, y2), y down.

    Raises:
        MessageError: it has no area, or its sides are swapped: a source that counts upwards, or
            that names width and height.
    """
    x1, y1, x2, y2 = edges
    if not (x1 < x2 and y1 < y2):
        needed = "left < right and top above bottom are needed"
        raise MessageError("malformed", f"{what}: {needed}, got {x1:g}, {y1:g}, {x2:g}, {y2:g}")
    return x1, y1, x2, y2


def each_row(
    rows: Any, what: str, read: Callable[[Any, str], _Row | None]
) -> Iterator[_Row | SkippedRow]:
    """Read the rows of a list one by one; a row that cannot be read is skipped, with its reason.

    `read` gets a row and its place (`detections/3`), and returns None if there is nothing to use.
    Of a message `rows` is what its field has, which may be no list; a file's rows may be iterated.

    Raises:
        MessageError: `rows` is no list.
    """
    given = rows if isinstance(rows, Iterator) else listed(rows, what)
    for at, row in enumerate(given):
        try:
            found = read(row, f"{what}/{at}")
        except MessageError as error:
            yield SkippedRow(error.code, error.detail)
            continue
        if found is not None:
            yield found


def table(value: Any, what: str) -> dict[str, Any]:
    """An object of a message.

    Raises:
        MessageError: it is none.
    """
    if not isinstance(value, dict):
        raise MessageError("malformed", f"{what}: an object is needed, got {value!r:.40}")
    return value


def check_json(message: bytes, most: int = MAX_MESSAGE_BYTES) -> None:
    """Reject JSON that is too large, or nested too deeply, before it is parsed.

    Raises:
        MessageError: it is.
    """
    check_size(message, most)
    levels = json_levels(message)
    if levels > MAX_LEVELS:
        raise MessageError("too_deep", f"at most {MAX_LEVELS} nested levels, got {levels}")


def check_size(message: bytes, most: int = MAX_MESSAGE_BYTES) -> None:
    """Refuse a message that is too large to be looked at.

    Raises:
        MessageError: it is.
    """
    if len(message) > most:
        raise MessageError("too_large", f"at most {most} bytes are taken, got {len(message)}")


def _is_whole(found: str) -> bool:
    return not any("\ud800" <= character <= "\udfff" for character in found)
