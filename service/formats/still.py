"""Still images: read to the last pixel, and written anew without anything that was beside them."""

import json
from dataclasses import dataclass

from service.errors import MalformedError, TooLargeError, UnsupportedMediaTypeError
from service.formats.confined import ReaderError, read_apart

_FORMATS = {"image/jpeg": "JPEG", "image/png": "PNG"}
_READER = "service.formats.still_reader"


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """A still image as it is kept: a JPEG of a size. `sent_width` is that of what came, upright."""

    jpeg: bytes
    width: int
    height: int
    sent_width: int


def read_still(body: bytes, media_type: str) -> Still:
    """The image of a body, made anew in a process of its own.

    Raises:
        UnsupportedMediaTypeError: neither JPEG nor PNG is said to come.
        TooLargeError: more pixels than are taken.
        MalformedError: it cannot be decoded as what it is said to be, or not within a reader's
            limits of time and memory.
    """
    if media_type not in _FORMATS:
        raise UnsupportedMediaTypeError(
            f"Content-Type: image/jpeg or image/png is needed, got {media_type or 'none'}"
        )
    try:
        line, _, jpeg = read_apart(_READER, body, _FORMATS[media_type]).partition(b"\n")
    except ReaderError as error:
        raise MalformedError(f"body: {error}") from error
    said = json.loads(line)
    if "pixels" in said:
        raise TooLargeError(f"body: at most {said['most']} pixels are taken, got {said['pixels']}")
    if "refused" in said:
        raise MalformedError(f"body: {said['refused']}")
    return Still(jpeg=jpeg, **said)
