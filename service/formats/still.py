"""Still images: read to the last pixel, and written anew without anything that was beside them."""

import warnings
from dataclasses import dataclass
from io import BytesIO

from service.errors import MalformedError, TooLargeError, UnsupportedMediaTypeError

_MOST_PIXELS = 50_000_000
_LONGEST_SIDE = 1920  # behind a drawing, more is not seen
_QUALITY = 82
_FORMATS = {"image/jpeg": "JPEG", "image/png": "PNG"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """A still image as it is kept: a JPEG of a size."""

    jpeg: bytes
    width: int
    height: int


def read_still(body: bytes, media_type: str) -> Still:
    """The image of a body, made anew: no EXIF, no place, no comment comes along.

    Raises:
        UnsupportedMediaTypeError: neither JPEG nor PNG is said to come.
        TooLargeError: more pixels than are taken.
        MalformedError: it cannot be decoded as what it is said to be.
    """
    if media_type not in _FORMATS:
        raise UnsupportedMediaTypeError(
            f"Content-Type: image/jpeg or image/png is needed, got {media_type or 'none'}"
        )
    from PIL import Image, ImageOps  # few cameras have a picture

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of images that grow when they are unpacked
            found = Image.open(BytesIO(body), formats=(_FORMATS[media_type],))
            if found.width * found.height > _MOST_PIXELS:
                raise TooLargeError(
                    f"body: at most {_MOST_PIXELS} pixels are taken, "
                    f"got {found.width} x {found.height}"
                )
            # A camera that was mounted on its side says so in EXIF, which is not kept.
            image = ImageOps.exif_transpose(found).convert("RGB")
    except (OSError, ValueError, SyntaxError, Warning, Image.DecompressionBombError) as error:
        raise MalformedError(f"body: not a whole {_FORMATS[media_type]} image: {error}") from error
    image.thumbnail((_LONGEST_SIDE, _LONGEST_SIDE))
    made = BytesIO()
    image.save(made, "JPEG", quality=_QUALITY, exif=b"", icc_profile=None, comment=b"")
    return Still(jpeg=made.getvalue(), width=image.width, height=image.height)
