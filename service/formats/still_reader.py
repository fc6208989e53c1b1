"""Reads one image from stdin and writes it anew to stdout, after a line of JSON about it.

A process of its own, see `confined`: a small file can have thousands of scans, each of which is
gone through for every pixel. `python -m service.formats.still_reader CPU_S JPEG|PNG`.
"""

import json
import sys
import warnings
from io import BytesIO

# A phone's JPEG of several pictures is read by the third: no file can be opened once it is needed.
from PIL import Image, ImageOps, MpoImagePlugin, UnidentifiedImageError  # noqa: F401

from service.formats.confined import give_up_rights

_MOST_PIXELS = 50_000_000
_LONGEST_SIDE = 1920  # behind a drawing, more is not seen
_QUALITY = 82


def main() -> None:
    """Answer for the image on stdin: `{"width", "height", "sent_width"}`, or `{"refused": why}`."""
    cpu_s, form = int(sys.argv[1]), sys.argv[2]
    body = sys.stdin.buffer.read()
    _load_all()
    give_up_rights(cpu_s)
    said, jpeg = _read(body, form)
    sys.stdout.buffer.write(json.dumps(said).encode() + b"\n" + jpeg)


def _load_all() -> None:
    """Have the library import what it needs, while files can still be opened."""
    exif = Image.Exif()
    exif[0x0112] = 6  # turned
    Image.preinit()  # JPEG and PNG are among these few
    for form in ("JPEG", "PNG"):
        made = BytesIO()
        Image.new("RGB", (2, 1)).save(made, form, exif=exif)
        _read(made.getvalue(), form)


def _read(body: bytes, form: str) -> tuple[dict[str, str | int], bytes]:
    """The image made anew: no EXIF, no place, no comment comes along."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of images that grow when they are unpacked
            found = Image.open(BytesIO(body), formats=(form,))
            if found.width * found.height > _MOST_PIXELS:
                pixels = f"{found.width} x {found.height}"
                return {"pixels": pixels, "most": _MOST_PIXELS}, b""
            # A camera that was mounted on its side says so in EXIF, which is not kept.
            image = ImageOps.exif_transpose(found).convert("RGB")
    except UnidentifiedImageError:  # its message names a Python object
        return {"refused": f"not a {form} image"}, b""
    except (OSError, ValueError, SyntaxError, Warning, Image.DecompressionBombError) as error:
        return {"refused": f"not a whole {form} image: {error}"}, b""
    except MemoryError:
        return {"refused": f"not a whole {form} image: reading it takes too much memory"}, b""
    sent_width = image.width
    image.thumbnail((_LONGEST_SIDE, _LONGEST_SIDE))
    made = BytesIO()
    image.save(made, "JPEG", quality=_QUALITY, exif=b"", icc_profile=None, comment=b"")
    sizes = {"width": image.width, "height": image.height, "sent_width": sent_width}
    return dict(sizes), made.getvalue()


if __name__ == "__main__":
    main()
