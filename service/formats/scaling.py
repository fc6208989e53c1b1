"""The picture that a post's numbers are of: mostly a detector's smaller stream, or shares of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.geometry.rotation import Array

_LARGEST_PX = 100_000
FIELDS = ("size", "normalised")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """Pixels of the camera's own picture, `factor * number + shift`, for u and for v.

    Both count from the centre of their first pixel; shares of the picture count from its edge.
    """

    factor: tuple[float, float]
    shift: tuple[float, float]
    normalised: bool = False

    def applied(self, rows: Array) -> Array:
        """Rows (N, 3) or (N, 5) of time, u, v, u, v with their numbers in the camera's pixels."""
        scaled = rows.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused by name
            for column in range(1, rows.shape[1]):
                at = (column - 1) % 2
                scaled[:, column] = rows[:, column] * self.factor[at] + self.shift[at]
        return scaled


def read_scaling(size: Any, normalised: Any, picture: tuple[int, int]) -> Scaling | None:
    """How numbers come into a camera's picture (width, height); None where they are of it.

    They are of a picture of `size` [width, height], or shares of one, 0 to 1, where `normalised`:
    `size` then says nothing.

    Raises:
        ValueError: with the field, what is needed and what came.
    """
    if normalised is not None and not isinstance(normalised, bool):
        raise ValueError(f"normalised: true or false is needed, got {normalised!r:.40}")
    if size is not None and not _is_size(size):
        needed = f"[width, height] above 0 and at most {_LARGEST_PX} px is needed"
        raise ValueError(f"size: {needed}, got {size!r:.60}")
    if normalised:
        factor = (float(picture[0]), float(picture[1]))
        return Scaling(factor=factor, shift=(-0.5, -0.5), normalised=True)
    if size is None or tuple(size) == picture:
        return None
    u, v = picture[0] / size[0], picture[1] / size[1]
    return Scaling(factor=(u, v), shift=((u - 1) / 2, (v - 1) / 2))


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
