"""Requests that carry tracks as JSON and NDJSON, and what all forms have in common."""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from itertools import islice
from typing import Any

from models.effort import EffortExceededError, check_effort, limited_effort
from service.errors import FieldError, MalformedError, TooLargeError
from service.formats.json_body import (
    DOCUMENT_FIELDS,
    TrackTexts,
    is_large,
    read_document,
    read_line,
)
from service.formats.json_track import TRACK_FIELDS, read_track
from service.formats.track import (
    MAX_ID_LENGTH,
    MAX_TRACKS,
    Batch,
    Clock,
    IncomingTrack,
    Limits,
    Rejection,
    TrackSkippedError,
    is_text,
)
from surefoot.people import SkipReason
from surefoot.times import restore_plus
from surefoot.track_rules import TrackRejectedError, refuse

DEFAULT_SOURCE = "unnamed"
_FAR_S = 1e12
MOST_IGNORED = 20  # names of unknown fields in an answer
MOST_CLASSES = 12  # classes in a message
MAX_CPU_S = 10.0  # of reading one body: the largest honest ones take one or two
_MOST_ENDS = 4 * MAX_TRACKS  # of lines, blank ones among them


@contextmanager
def reading() -> Iterator[None]:
    """Have what reads a body, and looks at `check_effort`, end once it has taken its CPU time.

    Counts are bounded before anything is read: this ends what nobody thought of.

    Raises:
        TooLargeError: it has.
    """
    try:
        with limited_effort(MAX_CPU_S):
            yield
    except EffortExceededError as error:
        raise TooLargeError(
            f"body: at most {MAX_CPU_S:g} s of CPU are spent on reading one, got more; "
            "post a part of the tracks at once"
        ) from error


def read_json(body: bytes, clock: Clock, limits: Limits) -> Batch:
    """The tracks of `{"source", "tracks": [...], "frame_rate_hz"?, "started_at"?}`.

    `size` and `normalised` in it are of every track that does not say its own.

    `clock` is of what the body does not say.

    Raises:
        MalformedError: the body is no such object. One bad track is no reason.
        TooLargeError: too many tracks.
    """
    try:
        document = read_document(body)
    except (ValueError, RecursionError) as error:
        raise malformed(f"not JSON: {error}") from error
    if not isinstance(document, dict):
        raise malformed(f"an object with tracks is needed, got {type(document).__name__}")
    tracks = document.get("tracks")
    if not isinstance(tracks, list | TrackTexts):
        raise MalformedError.of_field("tracks", "a list of tracks is needed")
    check_count(len(tracks))
    source = read_source(document.get("source", DEFAULT_SOURCE))
    rate, start = document.get("frame_rate_hz"), document.get("started_at")
    clock = Clock(
        frame_rate_hz=clock.frame_rate_hz if rate is None else read_rate(rate),
        started_at_s=clock.started_at_s if start is None else read_time(start),
    )
    try:
        limits = limits.of_size(document.get("size"), document.get("normalised"))
    except ValueError as error:
        raise MalformedError.of_field(*str(error).split(": ", 1)) from error
    limits = limits.of_source(source)
    try:
        return collect(
            source,
            (
                (index, raw, partial(read_track, raw, source, clock, limits))
                for index, raw in enumerate(tracks)
            ),
            ignored=[name for name in document if name not in DOCUMENT_FIELDS],
        )
    except (ValueError, RecursionError) as error:
        raise malformed(f"not JSON: {error}") from error


def read_ndjson(body: bytes, source: str, clock: Clock, limits: Limits) -> Batch:
    """The tracks of a text with a JSON object on each line; bad lines are named by their index.

    Raises:
        TooLargeError: too many lines.
    """
    ends = body.count(b"\n")
    if ends > _MOST_ENDS:
        raise TooLargeError(f"lines: at most {_MOST_ENDS} ends of one are taken, got {ends}")
    limits = limits.of_source(source)
    lines = [line for line in body.split(b"\n") if line.strip()]
    check_count(len(lines))

    def items() -> Iterator[tuple[int, Any, Callable[[], IncomingTrack]]]:
        for index, line in enumerate(lines):
            try:
                raw = read_line(line) if is_large(body) else json.loads(line)
            except (ValueError, RecursionError) as error:
                yield index, None, partial(refuse, f"not JSON: {error}")
            else:
                yield index, raw, partial(read_track, raw, source, clock, limits)

    return collect(source, items())


def read_source(value: Any) -> str:
    """The name of a tracker.

    Raises:
        MalformedError: no text of 1 to 200 characters.
    """
    if not isinstance(value, str) or not 1 <= len(value) <= MAX_ID_LENGTH or not is_text(value):
        reason = f"text of 1 to {MAX_ID_LENGTH} characters is needed, none of them NUL or half one"
        raise MalformedError.of_field("source", reason)
    return value


def read_rate(value: Any) -> float:
    """A frame rate in Hz.

    Raises:
        MalformedError: no number above 0 and at most 1000.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= 1000:
        reason = f"a number above 0 and at most 1000 is needed, got {value!r:.40}"
        raise MalformedError.of_field("frame_rate_hz", reason)
    return float(value)


def read_time(value: Any) -> float:
    """Return seconds since the epoch of an RFC 3339 time with a zone, or of such a number.

    Raises:
        MalformedError: the value is neither.
    """
    wrong = partial(MalformedError.of_field, "started_at")
    if isinstance(value, str):
        needed = "must be an RFC 3339 time with a zone, for example 2026-11-20T08:00:00Z"
        try:
            moment = datetime.fromisoformat(restore_plus(value))
        except ValueError as error:
            hint = "; encode + as %2B in a query" if " " in value else ""
            raise wrong(f"{needed}{hint}; got {value!r:.40}") from error
        if moment.tzinfo is None:
            raise wrong(f"{needed}; got {value!r:.40}")
        return moment.timestamp()
    # A whole number may be larger than any float.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _FAR_S:
        raise wrong(f"must be an RFC 3339 time or seconds since 1970; got {value!r:.40}")
    return float(value)


def collect(
    source: str,
    items: Iterable[tuple[int, Any, Callable[[], IncomingTrack]]],
    ignored: Iterable[str] = (),
) -> Batch:
    """Return the batch of tracks, each given with its index, its raw value and its reader.

    Unknown fields of tracks are added to `ignored`.

    Raises:
        TooLargeError: reading them takes too long.
    """
    with reading():
        return _collected(source, items, ignored)


def _collected(
    source: str,
    items: Iterable[tuple[int, Any, Callable[[], IncomingTrack]]],
    ignored: Iterable[str],
) -> Batch:
    tracks, rejections = [], []
    skipped: Counter[SkipReason] = Counter()
    others: dict[str, None] = {}
    names = dict.fromkeys(islice(map(brief_name, ignored), MOST_IGNORED))
    for index, raw, read in items:
        check_effort()
        if isinstance(raw, dict) and not raw.keys() <= TRACK_FIELDS:
            unknown = islice(sorted(raw.keys() - TRACK_FIELDS), MOST_IGNORED - len(names))
            names |= dict.fromkeys(f"tracks/*/{brief_name(name)}" for name in unknown)
        try:
            tracks.append(read())
        except TrackSkippedError as error:
            skipped[error.reason] += 1
            if error.reason == SkipReason.NOT_A_PERSON and len(others) < MOST_CLASSES:
                others.setdefault(brief_name(str(error.label)))
        except TrackRejectedError as refused:
            name = raw.get("id") if isinstance(raw, dict) else getattr(raw, "id", None)
            known = isinstance(name, str | int) and not isinstance(name, bool)
            text = str(name)[:MAX_ID_LENGTH].encode(errors="replace").decode()
            rejections.append(
                Rejection(
                    index=index,
                    track_id=text if known else None,
                    code=refused.code,
                    detail=refused.detail,
                )
            )
    return Batch(
        source=source,
        tracks=tuple(tracks),
        rejections=tuple(rejections),
        skipped=dict(skipped),
        other_classes=tuple(others),
        ignored=tuple(names),
    )


def brief_name(name: str) -> str:
    """The name of a field as far as an answer says it."""
    return name[:80].encode(errors="replace").decode()


def check_count(count: int) -> None:
    """Refuse more tracks than a request may have.

    Raises:
        TooLargeError: there are more.
    """
    if count > MAX_TRACKS:
        raise TooLargeError(
            f"tracks: at most {MAX_TRACKS} a request are taken, got {count} or more"
        )


def malformed(reason: str) -> MalformedError:
    """The error of a body that cannot be read."""
    return MalformedError("the body cannot be read", (FieldError(pointer="", reason=reason),))
