"""The image that the numbers of a post belong to: often a detector's smaller stream, or shares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.tracks.scaling import SAME, Scaling, scaling_of_shares, scaling_of_size

_LARGEST_PX = 100_000
FIELDS = ("size", "normalised")


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSize:
    """The image that a source's numbers belong to if its posts do not state one.

    `size` is (width, height) in pixels. Without it the numbers are shares of the image
    (`normalised`), or pixels of the camera's frame.
    """

    size: tuple[float, float] | None = None
    normalised: bool = False

    def scaling(self, frame: tuple[int, int]) -> Scaling:
        """The map of its numbers to the pixels of a frame (width, height)."""
        return read_scaling(self.size, self.normalised, frame) or SAME

    @property
    def stored(self) -> list[float] | None:
        """The size as a camera's column has it; None for shares."""
        return None if self.size is None else list(self.size)


def image_sizes_of(stored: Mapping[str, Any] | None) -> dict[str, ImageSize]:
    """The declared image sizes by source, from a camera's column."""
    return {
        source: ImageSize(normalised=True) if size is None else ImageSize(size=(size[0], size[1]))
        for source, size in (stored or {}).items()
    }


def read_scaling(size: Any, normalised: Any, picture: tuple[int, int]) -> Scaling | None:
    """Return the map of numbers to a camera's frame (width, height); None if they are its pixels.

    The numbers are pixels of an image of `size` [width, height], or shares of one, 0 to 1, if
    `normalised` is true; `size` is then ignored.

    Raises:
        ValueError: with the field, the allowed values and the value received.
    """
    if normalised is not None and not isinstance(normalised, bool):
        raise ValueError(f"normalised: true or false is needed, got {normalised!r:.40}")
    if size is not None and not _is_size(size):
        needed = f"[width, height] above 0 and at most {_LARGEST_PX} px is needed"
        raise ValueError(f"size: {needed}, got {size!r:.60}")
    if normalised:
        return scaling_of_shares(picture)
    if size is None or tuple(size) == picture:
        return None
    return scaling_of_size((size[0], size[1]), picture)


def read_size(text: str) -> list[float]:
    """The size in a query: `1280,720`.

    Raises:
        ValueError: it is not two numbers with a comma between them.
    """
    try:
        width, height = map(float, text.split(","))
    except ValueError as error:
        raise ValueError(f"size: width,height is needed, got {text!r:.60}") from error
    return [width, height]


def _is_size(value: Any) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(type(number) in (int, float) and 0 < number <= _LARGEST_PX for number in value)
    )
