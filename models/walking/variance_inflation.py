"""Squared errors over what a curvature says, by the reference's own times; and shrunken offsets.

Ours: the mean of e' S^-1 e over the number of parameters, held out, e being what is off and S its
covariance; an offset is shrunk by its own noise, K = P (P + S)^-1 for a plausible P, which is as
large as the offset itself asks for (empirical Bayes: Morris 1983).
"""

from collections.abc import Callable

import numpy as np

from models.geometry.rotation import Array, Index
from models.walking import config


def variance_inflation(
    tracks: Index, error_ratio: Callable[[Index, Index], float], assumed: float
) -> float:
    """The mean of squared errors over predicted variances, from some times to others; at least 1.

    The earlier half and the later, the quarters by turns, the eighths and the sixteenths: people
    drawn at random would share their hour, and those who are seen afterwards do not.

    `tracks` are in the order of time. `error_ratio` is e' S^-1 e over the number of parameters,
    from tracks to train by and to test; `assumed` is the ratio before any are seen.
    """
    ratios = []
    for fold in range(config.INFLATION_FOLDS):
        odd = np.arange(tracks.size) * 2 ** (fold + 1) // tracks.size % 2 == 1
        parts = (tracks[~odd], tracks[odd])
        for train, test in (parts, parts[::-1]):
            if min(train.size, test.size) >= 2:
                ratios.append(min(error_ratio(train, test), config.LARGEST_RATIO))
    guess = assumed * config.ASSUMED_INFLATION_WEIGHT
    return max(1.0, (sum(ratios) + guess) / (len(ratios) + config.ASSUMED_INFLATION_WEIGHT))


def squared_ratio(error: Array, covariance: Array) -> float:
    """E' S^-1 e of an error (P,) with a covariance (P, P), over P."""
    return float(error @ np.linalg.solve(covariance, error)) / error.size


def shrink_offset(offset: Array, noise: Array, plausible_sd: Array) -> tuple[Array, Array]:
    """An offset (P,) shrunk by its noise (P, P), and the covariance of what is left.

    A bias is of about the plausible size, and what the tracks leave free is not taken for one; but
    where they leave no doubt, people walk unlike those of most sites, and it is a large one.
    """
    plausible = np.diag(np.maximum(plausible_sd**2, offset**2 - np.diag(noise)))
    kept = plausible @ np.linalg.inv(plausible + noise)
    return kept @ offset, kept @ noise
