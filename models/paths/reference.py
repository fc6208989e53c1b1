"""The paths of a site, learned of tracks at a known pose, and how registration errs there.

Source: Godambe 1960, the information of an estimating function, H J^-1 H, whose J has the scatter
of walking groups here, the noise of the map and what is not known of the bias.
"""

from dataclasses import dataclass

import numpy as np

from models.errors import CheckpointError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, array_of
from models.geometry.rotation import Array
from models.paths import config
from models.paths.coverage import Coverage, coverage_of
from models.paths.density_map import PathDensityMap, of_levels, to_levels
from models.paths.folds import ChosenBandwidths, CrossFit, Folds, cross_fit, fold_maps
from models.paths.likelihood import PathModel, walkers_of
from models.paths.map_learning import path_model_of
from models.paths.path_tests import (
    FEWEST_USUAL,
    StillScores,
    UsualFit,
    learn_scores,
    usual_fit,
)
from models.paths.registration import Shape
from models.serialization import Format, flattened, from_bytes, restored, to_bytes, under
from models.tracks.observations import Observations


@dataclass(frozen=True, slots=True, kw_only=True)
class PathReference:
    """The paths of a site, and how registration errs there.

    `bias` (4,) is a person's mean score at the truth, by tilt, roll, log height and heading,
    `bias_covariance` (4, 4) how unsure that is, `spread` (4,) how much people's scores scatter.
    `curvature_variance_inflation` is how much larger squared errors are than the curvature at a
    peak says, and `score_variance_inflation` than curvature and the scatter of walking groups
    together say, for a map of endless people; this one is of `people`. `still` and `fit` are what
    its two tests go by, `place_fit` the same for places alone. `bandwidths` are what the map was
    learned by, for the next one.
    """

    density: PathDensityMap
    coverage: Coverage
    bias: Array
    bias_covariance: Array
    spread: Array
    curvature_variance_inflation: float
    score_variance_inflation: float
    people: float
    still: StillScores
    fit: UsualFit
    place_fit: UsualFit
    bandwidths: ChosenBandwidths

    def model(self, intrinsics: Intrinsics) -> PathModel:
        """The paths before a camera: what walkers are registered to."""
        return PathModel(density=self.density, coverage=self.coverage, intrinsics=intrinsics)

    def variance_inflation_for(self, people: float) -> float:
        """The inflation of squared errors over what the curvature says, for so many people."""
        return self.curvature_variance_inflation * self.map_noise(people)

    def map_noise(self, people: float) -> float:
        """The noise of map and walkers over that of the walkers.

        Who made the map pulls the new people's pose as far as they would, were they new.
        """
        return 1 + people / self.people

    def precision(self, shape: Shape, people: float, move: Array) -> Array:
        """The precision (4, 4) of the map's part, by its shape some way (4,) from the prior pose.

        Source: the inverse of the sandwich covariance (Godambe's information). On top of the
        walkers' noise comes the map's, and what the bias is not known to be: at another pose, other
        people walk at the edge of what is seen.
        """
        far = min(float(np.linalg.norm(move / config.FAR)), 1.0)
        elsewhere = np.diag((config.BIAS_ELSEWHERE * far * self.spread) ** 2)
        scatter = self.score_variance_inflation * self.map_noise(people) * shape.noise
        scatter = scatter + people**2 * (self.bias_covariance + elsewhere)
        scatter = scatter + 1e-9 * np.trace(scatter) * np.eye(4)
        return np.asarray(shape.curvature @ np.linalg.solve(scatter, shape.curvature))


def learn_paths(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    seed: int,
    weights: Array | None = None,
    folds: Folds | None = None,
) -> PathReference | None:
    """The paths of tracks at the prior pose.

    None where fewer than 12 walking groups walk, or where the map of some tells nothing of others.

    A map knows the tracks that it is made of too well. So each quarter of the walking groups is
    held against a map of the others: what their scores are on average is the bias, how much more
    they scatter in runs of walking groups after one another than walking groups do is the inflation
    of their variance.

    `weights` (tracks,) are what each counts for, 0 to 1, else 1; `folds` are of the same tracks and
    seed, where they have been made already.
    """
    at = array_of(prior)
    if folds is None:
        folds = fold_maps(observations, intrinsics, at, seed, weights)
    if folds is None:
        return None
    crossed = cross_fit(folds.each, at)
    if crossed.fits.size < FEWEST_USUAL or not np.ptp(crossed.slopes, axis=0).any():
        return None
    inflation, scatter = _scatter(crossed)
    parts_bent = float(np.trace(np.linalg.solve(scatter, crossed.curvature)))
    count = float(crossed.people.sum())
    # Each in the others' map and they in its: to first order, what noise does to the mean cancels.
    bias = crossed.slopes.sum(axis=0) / count
    unsure = config.BIAS_NOISE * inflation * scatter / count**2
    walkers = walkers_of(observations, at)
    weights = np.ones(observations.tracks) if weights is None else weights
    whole = path_model_of(walkers, weights, intrinsics, at, folds.chosen.bandwidths)
    counted = weights[np.unique(walkers.steps.rows.owner_idx)]
    return PathReference(
        density=whole.density,
        coverage=whole.coverage,
        bias=bias,
        bias_covariance=unsure,
        spread=np.sqrt(np.diag(scatter) / count),
        curvature_variance_inflation=inflation * max(1.0, 4 / max(parts_bent, 1e-9)),
        score_variance_inflation=inflation,
        people=float(counted.sum() ** 2 / (counted**2).sum()),
        still=learn_scores(crossed.scores, crossed.bent, seed),
        fit=usual_fit(crossed.fits),
        place_fit=usual_fit(crossed.place_fits),
        bandwidths=folds.chosen,
    )


def _scatter(crossed: CrossFit) -> tuple[float, Array]:
    """The inflation of the scores' variance, and what it is of.

    That is the scatter (4, 4) of the slopes' sum if walking groups are independent.
    """
    centred = crossed.slopes - crossed.slopes.mean(axis=0)
    scatter = centred.T @ centred + 1e-9 * np.trace(centred.T @ centred) * np.eye(4)
    whitened = np.linalg.solve(np.linalg.cholesky(scatter / len(centred)), centred.T).T
    runs = len(centred) // config.RUN
    sums = whitened[: runs * config.RUN].reshape(runs, config.RUN, 4).sum(axis=1)
    found = float((sums**2).mean() / config.RUN)
    weight = runs / (runs + config.ASSUMED_INFLATION_WEIGHT)
    return max(1.0, weight * found + (1 - weight) * config.ASSUMED_INFLATION), scatter


_FORMAT = Format(name="paths", version=1)


def paths_to_bytes(reference: PathReference) -> bytes:
    """A reference as it is stored."""
    values = flattened(reference)
    for name in flattened(reference.coverage, "coverage."):
        del values[name]  # made anew of the map
    values["density.log_density"] = to_levels(reference.density.log_density)
    values["density.unseen"] = np.rint(reference.density.unseen * 255).astype(np.uint8)
    return to_bytes(_FORMAT, values)


def paths_from_bytes(data: bytes) -> PathReference:
    """The reference of `paths_to_bytes`.

    Raises:
        CheckpointError: the bytes are no paths of this format.
    """
    values = from_bytes(_FORMAT, data)
    try:
        values["density.log_density"] = of_levels(values["density.log_density"])
        values["density.unseen"] = values["density.unseen"] / 255
    except KeyError as error:
        raise CheckpointError(f"paths: {error} is missing") from error
    density = restored(PathDensityMap, under(values, "density"))
    return restored(PathReference, values, coverage=coverage_of(density))
