"""Calibration files of strangers, read by `surefoot.calibration` in a process of its own.

The parsers of ZIP, XML and YAML are C, and a small file can be made to take long: see `confined`.
"""

import json
import threading
from functools import partial
from typing import Any

from models.geometry.intrinsics import Projection
from service.errors import MalformedError, OverloadedError
from service.formats.confined import MAX_SECONDS, ReaderError, read_apart
from surefoot.calibration.documents import check_size
from surefoot.calibration.value import Calibration, CalibrationFileError, Note

_AT_ONCE = 2
_READER = "service.formats.calibration_reader"
_LISTS = ("size", "matrix", "distortion", "rotation", "translation_m")

_malformed = partial(MalformedError.of_field, "file")
_free = threading.BoundedSemaphore(_AT_ONCE)


def read_calibration(
    body: bytes, camera: str | None = None, timeout_s: float = MAX_SECONDS
) -> Calibration:
    """The calibration of a camera in a file.

    Raises:
        MalformedError: it is none, a field of it is damaged, or it broke its reader.
        OverloadedError: too many are being read at once.
    """
    try:
        check_size(body)
    except CalibrationFileError as error:
        raise _malformed(_reason(str(error))) from error
    if not _free.acquire(blocking=False):
        raise OverloadedError(f"file: at most {_AT_ONCE} files are read at once", retry_after_s=2)
    try:
        answer: dict[str, Any] = json.loads(
            read_apart(_READER, body, camera or "", within_s=timeout_s)
        )
    except ReaderError as error:
        raise _malformed(str(error)) from error
    except ValueError as error:
        raise _malformed("its reader ended without an answer") from error
    finally:
        _free.release()
    if "rejected" in answer:
        raise _malformed(_reason(str(answer["rejected"])))
    lists = {name: tuple(answer.pop(name)) for name in _LISTS if answer[name] is not None}
    notes = {Note(name): values for name, values in answer.pop("notes").items()}
    projection = Projection(answer.pop("projection"))
    return Calibration(**(answer | lists), projection=projection, notes=notes)


def _reason(message: str) -> str:
    """A reader's message, beside the field it is about."""
    return message.removeprefix("file: ")
