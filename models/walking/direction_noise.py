"""Noise in the directions of walks, which looks like information.

A direction's noise is in the derivative of a step's log speed by the pose, and there its square
looks like information. Where people walk many ways it is a few per cent of what there is; on a
single path, where there is hardly any, it would make sure of a pose that is not identifiable.
Measured that way, 240 tracks of one path were 13 deg off in tilt and gave 1 deg as its deviation.

Source: Fuller 1987, Measurement Error Models: of regressors with noise of a known covariance the
moments less that noise, (M - N)^-1 M (M - N)^-1. What N is, and that at most 95 % of M are called
noise, is ours.
"""

import numpy as np

from models.geometry.rotation import Array
from models.walking.config import MOST_NOISE
from models.walking.measures import Measured
from models.walking.mixed.model import VarianceComponents, Weights
from models.walking.mixed.sums import information_of_noise


def noise_information(
    measured: Measured, weights: Weights, components: VarianceComponents
) -> Array:
    """The information (3, 3) on tilt, roll and log height that is noise's on average.

    Of a track's noise, its own level and trend take a part.
    """
    rows = measured.rows
    information = information_of_noise(
        measured.d_direction_noise, weights.row, measured.valid, rows.owner_idx, rows.owners
    )
    return information / components.within_sd**2


def corrected_covariance(matrix: Array, noise: Array) -> Array:
    """The covariance (3, 3) of a fit with information (3, 3) of which a part is noise.

    Errors scatter by all of the information and are brought back by the true part alone.
    """
    root = np.linalg.cholesky(matrix)
    white = np.linalg.solve(root, np.linalg.solve(root, noise).T)
    sizes, axes = np.linalg.eigh((white + white.T) / 2)
    stretched = np.linalg.solve(root.T, axes) / (1 - np.clip(sizes, 0.0, MOST_NOISE))
    return np.asarray(stretched @ stretched.T)
