"""The calibrated mean: the mean over tracks, put through the inverse of its learned bias curve."""

from dataclasses import dataclass

import numpy as np

from models.errors import ShapeError, TooFewTrajectoriesError
from models.geometry.rotation import (
    Array,
    angles_from_rotation,
    mean_quaternion,
    rotation_from_quaternion,
)
from models.regression.averaging import FEWEST_TRACKS, TrackPredictions
from studies.plane_estimate import PlaneEstimate

# Units in which the curve is a polynomial: radians of tilt and roll, log height.
_UNITS = np.array([0.1, 0.1, 0.2])
_TERMS = 13
_RIDGE = 1e-3
_FARTHEST = np.array([4.0, 4.0, 3.0])  # in those units: 23 deg, 0.6; the curve is not used beyond
_NEWTON_STEPS = 20
_RESAMPLES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The mean answer as a polynomial of the true pose, and how far sites stray from it.

    `prior` (3,) is tilt, roll and log height of the training's prior pose. `curve` is (13, 3): the
    mean's offset from the prior for the terms of `_terms` of the true offset. `site_covariance`
    (3, 3) is what remains with very many tracks. Offsets are in units of (0.1 rad, 0.1 rad, 0.2).

    Raises:
        ShapeError: an array of another shape.
    """

    prior: Array
    curve: Array
    site_covariance: Array

    def __post_init__(self) -> None:
        for name, shape in (("prior", (3,)), ("curve", (_TERMS, 3)), ("site_covariance", (3, 3))):
            if getattr(self, name).shape != shape:
                raise ShapeError(f"{name}: {shape} is needed, got {getattr(self, name).shape}")


def fit_calibration(
    prior: Array, true: Array, means: Array, sampling_covariance: Array
) -> Calibration:
    """The curve through the means (S, 3) of sets whose true parameters (S, 3) are known.

    `sampling_covariance` (S, 3, 3) is that part of each mean's scatter which more tracks would
    take away.

    Raises:
        ShapeError: fewer sets than the curve has terms.
    """
    if len(true) < 2 * _TERMS:
        raise ShapeError(f"sets: at least {2 * _TERMS} are needed, got {len(true)}")
    terms, answers = _terms((true - prior) / _UNITS), (means - prior) / _UNITS
    ridge = _RIDGE * len(true) * np.diag([0.0] * 4 + [1.0] * (_TERMS - 4))
    curve = np.linalg.solve(terms.T @ terms + ridge, terms.T @ answers)
    scatter = np.cov(answers - terms @ curve, rowvar=False)
    excess = scatter - sampling_covariance.mean(0) / np.outer(_UNITS, _UNITS)
    sizes, axes = np.linalg.eigh(excess)
    # Never less than a tenth of what was seen, whatever the difference of two estimates says.
    site = axes @ np.diag(np.maximum(sizes, 0.0)) @ axes.T + 0.1 * scatter
    return Calibration(prior=prior, curve=curve, site_covariance=site)


def calibrated_estimate(
    predictions: TrackPredictions, calibration: Calibration, seed: int
) -> PlaneEstimate:
    """The true parameters whose mean answer is the mean over these tracks.

    The covariance holds the tracks' scatter (bootstrap over tracks) and the sites', both carried
    through the inverse of the curve's slope.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks.
    """
    count = len(predictions)
    if count < FEWEST_TRACKS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {FEWEST_TRACKS} with a prediction are needed, got {count}"
        )
    mean = mean_plane_parameters(predictions)
    scatter = sampling_covariance(predictions, seed) / np.outer(_UNITS, _UNITS)
    offset, slope = _invert(calibration.curve, (mean - calibration.prior) / _UNITS)
    back = np.linalg.pinv(slope, rcond=0.02)
    covariance = back @ (scatter + calibration.site_covariance) @ back.T
    return PlaneEstimate(
        values=calibration.prior + offset * _UNITS,
        covariance=covariance * np.outer(_UNITS, _UNITS),
        tracks=count,
    )


def mean_plane_parameters(predictions: TrackPredictions, weights: Array | None = None) -> Array:
    """Tilt, roll and log height (..., 3) of the mean over tracks, weighted by (..., N)."""
    count = len(predictions)
    weights = np.ones(count) if weights is None else weights
    shape = (*weights.shape, 4)
    q = mean_quaternion(np.broadcast_to(predictions.quaternion_wxyz, shape), weights)
    tilt, roll, _ = angles_from_rotation(rotation_from_quaternion(q))
    height = weights @ predictions.height_m / weights.sum(-1)
    return np.stack([tilt, roll, np.log(np.maximum(height, 1e-3))], axis=-1)


def sampling_covariance(predictions: TrackPredictions, seed: int) -> Array:
    """The covariance (3, 3) of `mean_plane_parameters` by bootstrap over tracks."""
    count = len(predictions)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), _RESAMPLES)
    parameters = mean_plane_parameters(predictions, drawn.astype(np.float64))
    middle = mean_plane_parameters(predictions)[1]
    parameters[:, 1] = (parameters[:, 1] - middle + np.pi) % (2 * np.pi) - np.pi
    return np.atleast_2d(np.cov(parameters, rowvar=False))


def _invert(curve: Array, answer: Array) -> tuple[Array, Array]:
    """Offset (3,) whose curve is the answer, as near as the range allows, and the slope there."""
    offset = np.zeros(3)
    for _ in range(_NEWTON_STEPS):
        miss = answer - (_terms(offset[None]) @ curve)[0]
        step = np.linalg.lstsq(_slope(curve, offset), miss, rcond=0.02)[0]
        offset = np.clip(offset + np.clip(step, -1.0, 1.0), -_FARTHEST, _FARTHEST)
    return offset, _slope(curve, offset)


def _slope(curve: Array, offset: Array) -> Array:
    """Derivative (3, 3) of the curve's answers by the offsets."""
    h = 1e-4
    around = _terms(np.concatenate([offset + h * np.eye(3), offset - h * np.eye(3)])) @ curve
    return np.asarray((around[:3] - around[3:]).T / (2 * h))


def _terms(offset: Array) -> Array:
    """Terms (S, 13) of offsets (S, 3): 1, each, squares, products, cubes."""
    tilt, roll, height = offset.T
    return np.stack(
        [
            np.ones_like(tilt),
            tilt, roll, height,
            tilt**2, roll**2, height**2,
            tilt * roll, tilt * height, roll * height,
            tilt**3, roll**3, height**3,
        ],
        axis=-1,
    )  # fmt: skip
