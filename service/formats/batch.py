"""Requests that carry tracks: JSON, NDJSON and MOTChallenge text."""

import json
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from functools import partial
from typing import Any, NoReturn

import numpy as np

from service.errors import FieldError, MalformedError, TooLargeError
from service.formats.json_body import MAX_TRACK_CHARS, OversizedTrack, TrackTexts, read_document
from service.formats.track import (
    MAX_ID_LENGTH,
    MAX_TRACKS,
    Batch,
    Clock,
    IncomingTrack,
    Rejection,
    TrackRejectedError,
    check_track,
    is_text,
    read_track,
    track_name,
)

DEFAULT_SOURCE = "unnamed"
_FAR_S = 1e12


def read_json(body: bytes, clock: Clock, size: tuple[int, int]) -> Batch:
    """The tracks of `{"source", "tracks": [...], "frame_rate_hz"?, "started_at"?}`.

    Args:
        body: the request's body.
        clock: what to use where the body does not say it.
        size: width and height of the image in pixels.

    Raises:
        MalformedError: the body is no such object. One bad track is no reason.
        TooLargeError: too many tracks.
    """
    try:
        document = read_document(body)
    except (ValueError, RecursionError) as error:
        raise _malformed("", f"not JSON: {error}") from error
    if not isinstance(document, dict):
        raise _malformed("", f"an object with tracks is needed, got {type(document).__name__}")
    tracks = document.get("tracks")
    if not isinstance(tracks, list | TrackTexts):
        raise _malformed("/tracks", "a list of tracks is needed")
    _check_count(len(tracks))
    source = read_source(document.get("source", DEFAULT_SOURCE), "/source")
    rate, start = document.get("frame_rate_hz"), document.get("started_at")
    clock = Clock(
        frame_rate_hz=clock.frame_rate_hz if rate is None else read_rate(rate, "/frame_rate_hz"),
        started_at_s=clock.started_at_s if start is None else read_time(start, "/started_at"),
    )
    try:
        return _collect(
            (index, raw, partial(read_track, raw, source, clock, size))
            for index, raw in enumerate(tracks)
        )
    except (ValueError, RecursionError) as error:
        raise _malformed("", f"not JSON: {error}") from error


def read_ndjson(body: bytes, source: str, clock: Clock, size: tuple[int, int]) -> Batch:
    """The tracks of a text with a JSON object on each line; bad lines are named by their index.

    Raises:
        TooLargeError: too many lines.
    """
    lines = [line for line in body.split(b"\n") if line.strip()]
    _check_count(len(lines))

    def items() -> Iterator[tuple[int, Any, Callable[[], IncomingTrack]]]:
        for index, line in enumerate(lines):
            try:
                large = len(line) > MAX_TRACK_CHARS
                raw = OversizedTrack(characters=len(line)) if large else json.loads(line)
            except (ValueError, RecursionError) as error:
                yield index, None, partial(_refuse, f"not JSON: {error}")
            else:
                yield index, raw, partial(read_track, raw, source, clock, size)

    return _collect(items())


def read_mot(body: bytes, source: str, clock: Clock, size: tuple[int, int]) -> Batch:
    """The tracks of MOTChallenge text: `frame,id,left,top,width,height,conf,...` a line.

    A frame's time is `started_at + frame / frame_rate_hz`. Lines with conf 0 are marked "ignore"
    by that format and left out. A line that cannot be read costs its own track and no other; a
    rejection's index is the place of its track by first appearance.

    Raises:
        MalformedError: the rate or the start is missing, or no line at all can be read.
        TooLargeError: too many tracks.
    """
    if clock.frame_rate_hz is None or clock.started_at_s is None:
        raise _malformed("", "query: frame_rate_hz and started_at are needed with text/csv")
    rows: dict[str, list[list[float]]] = {}
    broken: dict[str, str] = {}
    text = body.decode("utf-8", errors="replace")
    for line_no, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or (line_no == 1 and line.lower().startswith("frame")):
            continue
        cells = [cell.strip() for cell in line.split(",")]
        track_id = cells[1][:MAX_ID_LENGTH] if len(cells) > 1 and cells[1] else f"line {line_no}"
        boxes = rows.setdefault(track_id, [])
        try:
            frame, _, left, top, width, height, *rest = (float(cell) for cell in cells[:7])
        except ValueError as error:
            broken.setdefault(track_id, f"line {line_no}: {error}; got {line[:80]!r}")
            continue
        if not (rest and rest[0] == 0):
            time_s = clock.started_at_s + frame / clock.frame_rate_hz
            boxes.append([time_s, left, top, left + width, top + height])
    if rows and len(broken) == len(rows):
        raise _malformed("", f"not MOTChallenge text: {next(iter(broken.values()))}")
    _check_count(len(rows))

    def read(track_id: str) -> IncomingTrack:
        if track_id in broken:
            _refuse(broken[track_id])
        array = np.array(rows[track_id], dtype=np.float64).reshape(-1, 5)
        return check_track(
            track_name(track_id), source, array[np.argsort(array[:, 0], kind="stable")], size
        )

    return _collect(
        (index, {"id": track_id}, partial(read, track_id)) for index, track_id in enumerate(rows)
    )


def read_source(value: Any, pointer: str) -> str:
    """The name of a tracker.

    Raises:
        MalformedError: no text of 1 to 200 characters.
    """
    if not isinstance(value, str) or not 1 <= len(value) <= MAX_ID_LENGTH or not is_text(value):
        reason = f"text of 1 to {MAX_ID_LENGTH} characters is needed, none of them NUL or half one"
        raise _malformed(pointer, reason)
    return value


def read_rate(value: Any, pointer: str) -> float:
    """A frame rate in Hz.

    Raises:
        MalformedError: no number above 0 and at most 1000.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= 1000:
        raise _malformed(pointer, f"a number above 0 and at most 1000 is needed, got {value!r:.40}")
    return float(value)


def read_time(value: Any, pointer: str) -> float:
    """Seconds since the epoch of an RFC 3339 time with a zone, or of a number of seconds.

    Raises:
        MalformedError: neither of the two.
    """
    if isinstance(value, str):
        try:
            moment = datetime.fromisoformat(value)
        except ValueError as error:
            raise _malformed(pointer, f"RFC 3339 is needed: {error}") from error
        if moment.tzinfo is None:
            raise _malformed(pointer, f"a time with its zone is needed, got {value!r:.40}")
        return moment.timestamp()
    # A whole number may be larger than any float.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _FAR_S:
        raise _malformed(pointer, f"RFC 3339 or seconds since 1970 are needed, got {value!r:.40}")
    return float(value)


def _collect(items: Iterable[tuple[int, Any, Callable[[], IncomingTrack]]]) -> Batch:
    tracks, rejections = [], []
    for index, raw, read in items:
        try:
            tracks.append(read())
        except TrackRejectedError as refused:
            name = raw.get("id") if isinstance(raw, dict) else None
            known = isinstance(name, str | int) and not isinstance(name, bool)
            rejections.append(
                Rejection(
                    index=index,
                    track_id=_sendable(str(name)[:MAX_ID_LENGTH]) if known else None,
                    code=refused.code,
                    detail=refused.detail,
                )
            )
    return Batch(tracks=tuple(tracks), rejections=tuple(rejections))


def _sendable(text: str) -> str:
    return text.encode("utf-8", errors="replace").decode()


def _refuse(detail: str) -> NoReturn:
    raise TrackRejectedError("malformed", detail)


def _check_count(count: int) -> None:
    if count > MAX_TRACKS:
        raise TooLargeError(f"tracks: at most {MAX_TRACKS} a request are taken, got {count}")


def _malformed(pointer: str, reason: str) -> MalformedError:
    return MalformedError(
        "the body cannot be read" if not pointer else f"{pointer[1:]}: {reason}",
        (FieldError(pointer=pointer, reason=reason),),
    )
