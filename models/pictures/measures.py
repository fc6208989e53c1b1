"""What a picture tells without any other: how bright, sharp and full it is, and its hashes."""

import hashlib
from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

# Of 8 bits each: grey values, shares, descriptors.
Pixels: TypeAlias = npt.NDArray[np.uint8]

EDGE_CELLS = (32, 18)  # across and down
_SMALL_PX = 320  # width at which brightness and sharpness are read: noise counts less there
_HASH_PX, _HASH_BITS = 32, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """Measures of a picture in grey, 0 to 255.

    `mean` and `spread` (standard deviation) are of its brightness, `dark` and `bright` the shares
    of pixels below 16 and above 239, `entropy_bits` that of its histogram, 0 to 8. `sharpness` is
    the Laplacian's variance by that of the picture, which light and contrast leave as it is.
    `edges` (18, 32) are the shares of edge pixels of its cells, 0 to 255. `digest` is the SHA-256
    of the pixels, and `phash` the 64 bits of its low frequencies, most significant bit first.

    Source: Pech-Pacheco et al. 2000 (the Laplacian's variance); Zauner 2010 (pHash).
    """

    mean: float
    spread: float
    dark: float
    bright: float
    entropy_bits: float
    sharpness: float
    edges: Pixels
    digest: str
    phash: str


def measure(grey: Pixels) -> Measures:
    """The measures of a picture in grey (H, W), uint8."""
    height, width = grey.shape
    small: Any = grey
    if width > _SMALL_PX:
        size = (_SMALL_PX, max(round(height * _SMALL_PX / width), 8))
        small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    shares = np.bincount(small.ravel(), minlength=256) / small.size
    some = shares[shares > 0]
    spread = float(small.std())
    laplacian = cv2.Laplacian(small, cv2.CV_32F)
    sobel = [cv2.Sobel(small, cv2.CV_32F, *axis) for axis in ((1, 0), (0, 1))]
    strength = cv2.magnitude(*sobel)
    edge = (strength > max(40.0, 2.0 * float(strength.mean()))).astype(np.float32)
    edges = cv2.resize(edge, EDGE_CELLS, interpolation=cv2.INTER_AREA)
    return Measures(
        mean=float(small.mean()),
        spread=spread,
        dark=float(shares[:16].sum()),
        bright=float(shares[240:].sum()),
        entropy_bits=float(-(some * np.log2(some)).sum()),
        sharpness=float(laplacian.var()) / max(spread**2, 1.0),
        edges=np.round(255 * edges).astype(np.uint8),
        digest=hashlib.sha256(np.ascontiguousarray(grey).data).hexdigest(),
        phash=_perceptual_hash(small),
    )


def _perceptual_hash(small: Pixels) -> str:
    square = cv2.resize(small, (_HASH_PX, _HASH_PX), interpolation=cv2.INTER_AREA)
    low = cv2.dct(square.astype(np.float32))[:_HASH_BITS, :_HASH_BITS].ravel()
    bits = low > np.median(low[1:])
    return "".join(f"{byte:02x}" for byte in np.packbits(bits).tolist())
