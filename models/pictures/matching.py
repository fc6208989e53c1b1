"""Matches between two pictures' features: which are the same place by how they look."""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Mask
from models.pictures import config
from models.pictures.features import Features
from models.pictures.measures import Pixels

Indices: TypeAlias = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """Places in both pictures (M): rays of the first (M, 3), z = 1, and of the second.

    `still` stand at the same place of the screen, `overlay` where clocks are written, too;
    `cells` (M,) number the part of the first picture that they are in, and `weights` (M,) what
    they count for, so that what fills a few cells is no crowd. `focal_px` is the second picture's
    focal length, by which residuals are pixels.
    """

    reference: Array
    now: Array
    still: Mask
    overlay: Mask
    cells: Indices
    weights: Array
    focal_px: float
    tolerance_px: float

    def __len__(self) -> int:
        return len(self.cells)

    def cells_of(self, chosen: Mask) -> int:
        """How many cells some of the matches (M,) are in."""
        return len(np.unique(self.cells[chosen]))


def lens_of(intrinsics: Intrinsics, width: int, height: int) -> Intrinsics:
    """The lens of a picture of another size: scaled, and cut on the side that is too long for it.

    A picture that was squeezed to another shape is taken for one that was cut.
    """
    scale = max(width / intrinsics.width, height / intrinsics.height)
    # Integers are pixel centres: the middle of the picture stays the middle.
    shift = [
        (scale * (c - (full - 1) / 2)) + (own - 1) / 2
        for c, full, own in (
            (intrinsics.cx, intrinsics.width, width),
            (intrinsics.cy, intrinsics.height, height),
        )
    ]
    return replace(
        intrinsics,
        width=width,
        height=height,
        fx=intrinsics.fx * scale,
        fy=intrinsics.fy * scale,
        cx=shift[0],
        cy=shift[1],
    )


def match(reference: Features, now: Features, intrinsics: Intrinsics) -> Matches:
    """The places that look alike in both pictures, and each like nothing else in the other.

    Source: Lowe 2004, section 7.1.
    """
    first, second = _alike(reference.descriptors, now.descriptors)
    lenses = [lens_of(intrinsics, each.width, each.height) for each in (reference, now)]
    points = [
        np.asarray(each, np.float64) for each in (reference.points_px[first], now.points_px[second])
    ]
    (ray, seen), (other, also) = (
        lens.rays(place) for lens, place in zip(lenses, points, strict=True)
    )
    both = seen & also
    ray, other = ray[both], other[both]
    places, others = points[0][both], points[1][both]
    size = np.array([reference.width, reference.height])
    ratio = now.width / reference.width
    still_px = config.STILL_PX / min(reference.analysed, now.analysed / ratio)
    same_shape = abs(now.height / now.width - reference.height / reference.width) < 0.01
    still = np.linalg.norm((others + 0.5) / ratio - (places + 0.5), axis=1) < still_px
    still &= same_shape
    level = (places[:, 1] + 0.5) / reference.height
    band = (level < config.OVERLAY_BAND) | (level > 1 - config.OVERLAY_BAND)
    cell = np.clip((places + 0.5) / size * config.CELLS, 0, np.array(config.CELLS) - 1).astype(int)
    cells = cell[:, 0] + config.CELLS[0] * cell[:, 1]
    crowd = np.bincount(cells, minlength=config.CELLS[0] * config.CELLS[1])[cells]
    return Matches(
        reference=ray,
        now=other,
        still=still,
        overlay=still & band,
        cells=cells,
        weights=np.minimum(1.0, config.OF_A_CELL / np.maximum(crowd, 1)),
        focal_px=(lenses[1].fx + lenses[1].fy) / 2,
        tolerance_px=config.TOLERANCE * max(now.width, now.height),
    )


def _alike(first: Pixels, second: Pixels) -> tuple[Indices, Indices]:
    """The rows of two sets of descriptors that are nearest to one another, clearly so."""
    if len(first) < 2 or len(second) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    one, other = first.astype(np.float32), second.astype(np.float32)
    # Squared distances as one product of matrices: OpenCV's matcher takes ten times as long.
    squared = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * (one @ other.T)
    rows = np.arange(len(one))
    nearest = squared.argmin(axis=1)
    least = squared[rows, nearest]
    mutual = squared.argmin(axis=0)[nearest] == rows
    squared[rows, nearest] = np.inf
    clear = mutual & (least < config.RATIO**2 * squared.min(axis=1))
    return rows[clear], nearest[clear]
