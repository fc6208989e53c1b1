"""Features of a picture: places that another picture can be compared by, and what it measures."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import cv2
import numpy as np
import numpy.typing as npt

from models import serialization
from models.errors import CheckpointError, ShapeError
from models.geometry.rotation import Array
from models.pictures import config
from models.pictures.measures import EDGE_CELLS, Measures, Pixels, measure

_FORMAT = serialization.Format(name="picture_features", version=1)
_DESCRIPTOR = 128


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownTurn:
    """The turn of a reference picture against the first of its gallery: see `turn.Turn`."""

    rotation: Array
    log_zoom: float
    covariance: Array

    def __post_init__(self) -> None:
        for name, array, shape in (
            ("rotation", self.rotation, (3,)),
            ("covariance", self.covariance, (4, 4)),
        ):
            if array.shape != shape or not np.isfinite(array).all():
                raise ShapeError(f"{name}: finite {shape} is needed, got {array.shape}")


def _first() -> KnownTurn:
    return KnownTurn(rotation=np.zeros(3), log_zoom=0.0, covariance=np.zeros((4, 4)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Features:
    """Features of an image of `width` x `height` pixels.

    No pixels are kept, but outlines of the scene can be reconstructed from descriptors.

    Points (N, 2) are pixels, float32; descriptors (N, 128) SIFT's, as their square roots, uint8.
    `analysed` is the share to which the picture was scaled down before: places are as good as its
    pixels. `known` is where a reference looks.

    Raises:
        ShapeError: arrays of other shapes or types, or numbers that are not finite.

    Source: Lowe 2004; Arandjelovic and Zisserman 2012 (the square roots).
    """

    points_px: npt.NDArray[np.float32]
    descriptors: Pixels
    width: int
    height: int
    analysed: float
    measures: Measures
    known: KnownTurn = field(default_factory=_first)

    def __post_init__(self) -> None:
        count = len(self.points_px)
        shapes: dict[str, tuple[npt.NDArray[Any], tuple[int, ...], type]] = {
            "points_px": (self.points_px, (count, 2), np.float32),
            "descriptors": (self.descriptors, (count, _DESCRIPTOR), np.uint8),
            "edges": (self.measures.edges, EDGE_CELLS[::-1], np.uint8),
        }
        for name, (array, shape, kind) in shapes.items():
            if array.shape != shape or array.dtype != kind:
                raise ShapeError(f"{name}: {shape} of {kind.__name__} is needed, got {array.shape}")
        if not np.isfinite(self.points_px).all():
            raise ShapeError("points_px: must be finite")
        for side in (self.width, self.height):
            if not config.LEAST_SIDE_PX <= side <= config.MOST_SIDE_PX:
                raise ShapeError(_side_limit(side))
        if not 0 < self.analysed <= 1:
            raise ShapeError(f"analysed: must be above 0 and at most 1, got {self.analysed}")

    def to_bytes(self) -> bytes:
        """The features as they are stored."""
        return serialization.to_bytes(_FORMAT, serialization.flattened(self))

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """The features of `to_bytes`.

        Raises:
            CheckpointError: the bytes are damaged, too many, or of another format or version.
        """
        values = serialization.from_bytes(_FORMAT, data, most_bytes=config.MOST_STORED_BYTES)
        try:
            return serialization.restored(cls, values)
        except CheckpointError:
            raise
        except (ValueError, TypeError, AttributeError) as error:
            raise CheckpointError(f"{_FORMAT.name}: not readable: {error}") from error


def describe(
    grey: Pixels,
    *,
    boxes: Array | None = None,
) -> Features:
    """The features of a picture in grey.

    Args:
        grey: (H, W) uint8. What is larger than `ANALYSED_PX` is scaled down.
        boxes: x1, y1, x2, y2 (N, 4) in pixels, of people, who are left out.

    Raises:
        ShapeError: no picture in grey, or too small or large a one; boxes of another shape.
    """
    _check(grey)
    height, width = grey.shape
    share = min(1.0, config.ANALYSED_PX / max(width, height))
    size = (round(width * share), round(height * share))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA) if share < 1 else grey
    sift = cv2.SIFT.create(nfeatures=config.MAX_FEATURES, contrastThreshold=config.CONTRAST)
    found, raw = sift.detectAndCompute(small, _outside(boxes, size, share))
    points = np.array([each.pt for each in found], np.float32).reshape(-1, 2)
    # Integers are pixel centres: the picture's corner is at (-0.5, -0.5), whatever its size.
    factor = np.array([width / size[0], height / size[1]], np.float32)
    return Features(
        points_px=np.asarray((points + 0.5) * factor - 0.5, np.float32),
        descriptors=_rooted(raw),
        width=width,
        height=height,
        analysed=float(share),
        measures=measure(grey),
    )


def describe_jpeg(jpeg: bytes) -> Features:
    """The features of a picture that was made by ourselves: it is decoded in this process.

    Raises:
        ShapeError: too small or large a picture.
    """
    decoded: Any = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    return describe(decoded)


def read_gallery(stored: Sequence[bytes]) -> tuple[Features, ...]:
    """Features of `to_bytes`, all or none: a gallery of another release begins anew."""
    try:
        return tuple(Features.from_bytes(each) for each in stored)
    except CheckpointError:
        return ()


def _check(grey: Pixels) -> None:
    if grey.ndim != 2 or grey.dtype != np.uint8:
        raise ShapeError(f"grey: (H, W) uint8 is needed, got {grey.shape} {grey.dtype}")
    for side in grey.shape:
        if not config.LEAST_SIDE_PX <= side <= config.MOST_SIDE_PX:
            raise ShapeError(_side_limit(side))
    if grey.size > config.MOST_PIXELS:
        raise ShapeError(f"grey: at most {config.MOST_PIXELS} pixels, got {grey.size}")


def _side_limit(side: int) -> str:
    return f"side: {config.LEAST_SIDE_PX} to {config.MOST_SIDE_PX} pixels, got {side}"


def _outside(boxes: Array | None, size: tuple[int, int], share: float) -> Pixels | None:
    """The mask, 255 where features may be; None where they may be anywhere."""
    if boxes is None or not len(boxes):
        return None
    given = np.asarray(boxes, np.float64)
    if given.ndim != 2 or given.shape[1] != 4 or not np.isfinite(given).all():
        raise ShapeError(f"boxes: finite (N, 4) are needed, got {given.shape}")
    mask = np.full(size[::-1], 255, np.uint8)
    low = np.clip(np.floor(given[:, :2] * share), 0, size).astype(int)
    high = np.clip(np.ceil(given[:, 2:] * share) + 1, 0, size).astype(int)
    for (x1, y1), (x2, y2) in zip(low.tolist(), high.tolist(), strict=True):
        mask[y1:y2, x1:x2] = 0
    return mask


def _rooted(raw: npt.NDArray[Any] | None) -> Pixels:
    """Square roots of descriptors of one sum each (N, 128): their distances are Hellinger's."""
    if raw is None or not len(raw):
        return np.zeros((0, _DESCRIPTOR), np.uint8)
    shares = raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-9)
    return np.asarray(np.minimum(np.round(512 * np.sqrt(shares)), 255), np.uint8)
