"""Calibrations as OpenCV's FileStorage keeps them: checked here, read in a process of its own.

OpenCV's parser is C++ that a file can crash, so that it never runs in the process of the API: see
`calibration_reader` and `confined`.
"""

import json
import re
import threading
from dataclasses import dataclass
from functools import partial
from typing import Any

from models.geometry.intrinsics import Projection
from service.errors import MalformedError, OverloadedError
from service.formats.confined import MAX_SECONDS, ReaderError, read_apart

MAX_BYTES = 1024 * 1024
MAX_DEPTH = 32  # brackets or tags in each other; OpenCV itself writes 4
MAX_INDENT = 200  # columns, by which YAML nests, too
_AT_ONCE = 2
_READER = "service.formats.calibration_reader"

_OPENING = re.compile(rb"(?P<open>[\[{]|<[A-Za-z_])|(?P<close>[\]}]|</|/>)")
_INDENT = re.compile(rb"^[ \t\-?:]*", re.MULTILINE)
_malformed = partial(MalformedError.of_field, "file")
_free = threading.BoundedSemaphore(_AT_ONCE)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationFile:
    """Numbers of a file; None where it has none. `rotation` has 9 numbers, or 3 of a vector."""

    matrix: tuple[float, ...] | None
    projection: Projection
    distortion: tuple[float, ...] | None
    rotation: tuple[float, ...] | None
    translation: tuple[float, ...] | None
    size: tuple[int, int] | None


def read_calibration(body: bytes, timeout_s: float = MAX_SECONDS) -> CalibrationFile:
    """The calibration in a file of OpenCV's.

    Raises:
        MalformedError: it is none, says nothing of a camera, what it says has another shape, or it
            broke its reader.
        OverloadedError: so many are being read that this one has to wait.
    """
    _check(body)
    if not _free.acquire(blocking=False):
        raise OverloadedError(
            f"file: {_AT_ONCE} files are read at once, and so many are", retry_after_s=2
        )
    try:
        answer: dict[str, Any] = json.loads(read_apart(_READER, body, within_s=timeout_s))
    except ReaderError as error:
        raise _malformed(str(error)) from error
    except ValueError as error:
        raise _malformed("its reader said nothing that makes sense") from error
    finally:
        _free.release()
    if "refused" in answer:
        raise _malformed(str(answer["refused"]))
    projection = Projection(answer.pop("projection"))
    parts = {name: None if value is None else tuple(value) for name, value in answer.items()}
    return CalibrationFile(projection=projection, **parts)


def _check(body: bytes) -> None:
    """Refuse what no calibration is, before anything with a stack to overflow looks at it."""
    if len(body) > MAX_BYTES:
        raise _malformed(f"at most {MAX_BYTES} bytes are taken, got {len(body)}")
    if not body.strip() or b"\0" in body:
        raise _malformed("an OpenCV file is needed, this is empty or binary")
    depth = 0
    for found in _OPENING.finditer(body):
        depth = max(depth + (1 if found.lastgroup == "open" else -1), 0)
        if depth > MAX_DEPTH:
            raise _malformed(f"lists or tags in each other: at most {MAX_DEPTH} are taken")
    if max(len(found.group()) for found in _INDENT.finditer(body)) > MAX_INDENT:
        raise _malformed(f"indent: at most {MAX_INDENT} columns are taken")
