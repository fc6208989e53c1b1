"""What is usual at each place of the picture, whoever else is there: a robust, smooth field.

It is told of the picture, not of the ground, and follows what is seen: so that people who all seem
faster in one corner, since the camera has turned, are not taken for others.
"""

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array

_CUTS = (2.0, 1.5, 1.1, 0.8, 0.8, 0.8)  # of a log: what is further off counts for nothing
_FIRM = 0.05  # of a feature's own weight holds it at nothing
_FREE_ROWS = 10.0  # a feature is free where so many times as much is seen
_FIRST = 0.6  # the quantile that it begins at: there are slower people who stand about
_MOST_ROWS = 4.0  # a track counts as so many rows at the most


def residuals(rays: Array, beside: Array, value: Array, owner_idx: npt.NDArray[np.int64]) -> Array:
    """How far logarithms (M,) are from what is usual where they were seen.

    Biweights whose reach narrows round by round: from the middle of all to the kind of which there
    are most (graduated non-convexity).

    Args:
        rays: undistorted, normalised places in the picture (M, 2).
        beside: what else the usual may depend on (M, K), about -1 to 1.
        value: the logarithms.
        owner_idx: the track of each (M,).
    """
    if not value.size:
        return value
    share = np.minimum(1.0, _MOST_ROWS / np.bincount(owner_idx)[owner_idx])
    wide = np.maximum(rays.std(axis=0), 1e-6)
    x, y = ((rays - rays.mean(axis=0)) / wide).T
    features = np.stack(
        [np.ones_like(x), x, y, x * x - 1, x * y, y * y - 1, *beside.T, *(beside * y[:, None]).T],
        axis=1,
    )
    # Heavy tails of places must not bend the middle.
    features = np.clip(features, -4.0, 4.0)
    hold = np.full(features.shape[1], _FIRM * share.sum() + _FREE_ROWS)
    hold[0] = 1e-6
    residual = value - _quantile(value, share)
    for cut in _CUTS:
        weight = share * np.clip(1 - (residual / cut) ** 2, 0.0, None) ** 2
        weighted = features * weight[:, None]
        field = np.linalg.solve(features.T @ weighted + np.diag(hold), weighted.T @ value)
        residual = value - features @ field
    return np.asarray(residual)


def _quantile(value: Array, share: Array) -> float:
    order = np.argsort(value)
    passed = np.cumsum(share[order])
    return float(value[order][np.searchsorted(passed, _FIRST * passed[-1])])
