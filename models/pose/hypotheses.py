"""The posterior over what moved: the camera stands, or moved in some of its four parameters.

A camera on a wall moves seldom, and mostly in one or two of tilt, roll, height and heading. To
estimate all four anew of every window makes a still camera jitter with the hour's people, and lets
the height take what the tilt should have.

Ours: each subset M of the parameters is a hypothesis, p(M | d) ~ p(M) t(d; 0, C + P_M, dof), with d
the estimate less the prior pose, C its covariance and P_M what a move in M comes to, near or far.
Source: Raftery 1995, the average over models; Lange, Little and Taylor 1989, Student's t.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.special import gammaln, log_ndtr, logsumexp

from models.geometry.pose import (
    ANGLES,
    PARAMETERS,
    CameraPose,
    PoseParameters,
    array_of,
    parameters_apart,
)
from models.geometry.rotation import Array, Mask
from models.monitoring.drift import Drift, MoveProbabilities, drift_between
from models.pose import config
from models.pose.pose_fit import FusedEstimate
from models.walking.config import FEWEST_GROUPS

_SUBSETS = np.array(list(product((False, True), repeat=len(PARAMETERS))))
# Of each hypothesis (K,): which parameters moved, and how far: the first is that none has.
_MOVED_IN = np.concatenate([_SUBSETS, _SUBSETS[1:]])
_FAR = np.arange(len(_MOVED_IN)) >= len(_SUBSETS)
_ALL = _MOVED_IN.all(axis=1)
_ALONE = _MOVED_IN.sum(axis=1) == 1
_SCALE, _PAN = (_ALONE & _MOVED_IN[:, PARAMETERS.index(name)] for name in ("height", "heading"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """Which parameters moved, `far` or not, how likely that is, and the offset (4,) if so."""

    moved: tuple[str, ...]
    far: bool
    weight: float
    offset: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PosePosterior:
    """A mixture over hypotheses: weights (K,), means (K, 4) and covariances (K, 4, 4).

    Means are offsets of tilt, roll, log height and heading from the prior pose. By the first
    hypothesis, none moved; `prior_squared` is its squared distance from what tracks say. Of those
    parameters that are not `seen` (4,), they say nothing. `pictured` is
    whether a picture has had its say, and `site_changed` how likely people walk otherwise for other
    reasons than the camera: 0 without a picture (`models.pose.picture`).

    The offset leans on how seldom cameras move; how far off it may be does not. It is asked of the
    hypotheses by which all may have moved: a turn that is too small to be noticed is in there.
    """

    prior: CameraPose
    weights: Array
    means: Array
    covariances: Array
    seen: Mask
    pictured: bool = False
    site_changed: float = 0.0
    prior_squared: float = 0.0

    @property
    def moved(self) -> float:
        """The probability that the camera moved."""
        return min(float(self.weights[1:].sum()), 1.0)  # a sum may exceed 1 by rounding

    @property
    def move(self) -> MoveProbabilities:
        """How likely a move is, and of what."""
        shares = np.minimum(self.weights @ _MOVED_IN, 1.0).tolist()
        return MoveProbabilities(
            moved=self.moved, parameters=dict(zip(PARAMETERS, shares, strict=True))
        )

    @property
    def turned(self) -> float:
        """The probability that an angle which the tracks tell changed, if the camera moved."""
        angles = self.seen & [name != "height" for name in PARAMETERS]
        turned = float(self.weights @ _MOVED_IN[:, angles].any(axis=1))
        return min(turned / max(self.moved, 1e-300), 1.0)

    @property
    def offset(self) -> Array:
        """The mean offset (4,)."""
        return np.asarray(self.weights @ self.means)

    @property
    def covariance(self) -> Array:
        """The covariance (4, 4) around the mean offset, whatever moved."""
        weights = self._free_weights
        apart = self.means[_ALL] - self.offset
        between = np.einsum("k,ki,kj->ij", weights, apart, apart)
        return np.asarray(np.einsum("k,kij->ij", weights, self.covariances[_ALL]) + between)

    @property
    def parameters(self) -> PoseParameters:
        """The pose, named."""
        return PoseParameters.of_array(array_of(self.prior) + self.offset)

    @property
    def sd(self) -> PoseParameters:
        """The standard deviations, named."""
        return PoseParameters.sd_of_array(self.covariance, self.parameters.height_m)

    def likeliest(self, most: int) -> list[Hypothesis]:
        """The likeliest hypotheses, the likeliest first."""
        return [
            Hypothesis(
                moved=tuple(n for n, own in zip(PARAMETERS, _MOVED_IN[k], strict=True) if own),
                far=bool(_FAR[k]),
                weight=float(self.weights[k]),
                offset=self.means[k],
            )
            for k in np.argsort(-self.weights, kind="stable")[:most].tolist()
        ]

    def interval(self, name: str, level: float) -> tuple[float, float]:
        """The central interval of a parameter's offset that holds it with a probability.

        Whatever moved; the mean offset is in it.
        """
        at = PARAMETERS.index(name)
        means, sds = self.means[_ALL, at], np.sqrt(self.covariances[_ALL, at, at])
        tails = ((1 - level) / 2, (1 + level) / 2)
        low, high = (_quantile(self._free_weights, means, sds, tail) for tail in tails)
        offset = float(self.offset[at])
        return min(low, offset), max(high, offset)

    @property
    def _free_weights(self) -> Array:
        """The weights (2,) of all having moved, near and far, by themselves."""
        weights = self.weights[_ALL]
        whole = weights.sum()
        return weights / whole if whole > 0 else np.array([1.0, 0.0])


def pose_posterior(
    fused: FusedEstimate,
    walking_groups: int,
    prior: CameraPose,
    moved_prior: float = config.MOVED_PRIOR,
) -> PosePosterior:
    """The posterior over what moved, by an estimate of a window.

    Few walking groups tell less surely what their covariance is, and too few nothing; of a heading
    that the paths do not hold, the estimate says nothing. `moved_prior` is how likely a move is
    before any track.
    """
    seen = seen_parameters(fused, walking_groups)
    offset = parameters_apart(fused.values, array_of(prior))
    noise = fused.covariance[np.ix_(seen, seen)]
    degrees = degrees_of_freedom(walking_groups)
    moves = move_covariances()
    marginals = noise + moves[:, seen][:, :, seen]
    gains = np.linalg.solve(marginals, moves[:, seen]).transpose(0, 2, 1)
    squared = np.einsum("i,kij,j->k", offset[seen], np.linalg.inv(marginals), offset[seen])
    if seen.any():
        squared[0] = _at_prior(float(squared[0]), fused.prior_gap, walking_groups)
    log_weights = log_prior(moved_prior) + log_student(squared, marginals, degrees)
    means = gains @ offset[seen]
    # The variance of a t: of few groups it is wider than that of a normal distribution.
    heavy = (degrees + squared) / (degrees + seen.sum() - 2)
    covariances = (moves - gains @ moves[:, seen]) * heavy[:, None, None]
    covariances = covariances + np.diag(config.REST_SD**2)
    if fused.paths_changed:
        away = _FAR & _MOVED_IN[:, PARAMETERS.index("heading")]
        log_weights += np.log(np.where(away, config.LEAVES_PATHS, config.PATHS_CHANGE))
    return PosePosterior(
        prior=prior,
        weights=np.exp(log_weights - logsumexp(log_weights)),
        means=means,
        covariances=covariances,
        seen=seen,
        prior_squared=float(squared[0]),
    )


def of_people_who_tell_nothing(prior: CameraPose, moved_prior: float) -> PosePosterior:
    """The posterior over what moved before anybody has walked by."""
    moves = move_covariances()
    return PosePosterior(
        prior=prior,
        weights=np.exp(log_prior(moved_prior)),
        means=np.zeros((len(moves), len(PARAMETERS))),
        covariances=moves + np.diag(config.REST_SD**2),
        seen=np.zeros(len(PARAMETERS), bool),
    )


def move_covariances() -> Array:
    """Covariances (K, 4, 4) of how far what moved does, by each hypothesis."""
    spreads = (
        np.where(_MOVED_IN, config.MOVE_SD, 0.0) * np.where(_FAR, config.FAR_MOVE, 1.0)[:, None]
    )
    return np.asarray(np.einsum("ki,ij->kij", spreads**2, np.eye(len(PARAMETERS))))


def seen_parameters(fused: FusedEstimate, walking_groups: int) -> Mask:
    """Of which parameters (4,) tracks say something."""
    enough = walking_groups >= FEWEST_GROUPS
    return np.array([enough and (fused.registered or n != "heading") for n in PARAMETERS])


def off_sd_at_odds(
    log_odds: float, variances: Array, seen: Mask, walking_groups: Array, moved_prior: float
) -> Array:
    """How far off (S, N) in one parameter alone an estimate is, for a near move to be so likely.

    In standard deviations; infinite where none is far enough.

    `variances` (S, N) are of the S parameters that are `seen` (4,), `walking_groups` (N,) of the
    windows.
    """
    priors = log_prior(moved_prior)[: len(_SUBSETS)]
    alone = _ALONE[: len(_SUBSETS)] @ (_SUBSETS * priors[:, None])
    degrees, size = degrees_of_freedom(walking_groups), int(seen.sum())
    wider = 1 + config.MOVE_SD[seen, None] ** 2 / variances
    # With x the squared offset by its degrees of freedom, the two t's are to each other as
    # (1 + x) to (1 + x / wider): `ratio`, by the odds that are wanted.
    evidence = log_odds - (alone[seen, None] - priors[0]) + np.log(wider) / 2
    ratio = np.exp(2 * evidence / (degrees + size))
    with np.errstate(divide="ignore"):
        squared = degrees * np.maximum(ratio - 1, 0.0) / np.maximum(1 - ratio / wider, 0.0)
    return np.asarray(np.sqrt(squared))


def drift_of(posterior: PosePosterior, fused: FusedEstimate) -> Drift:
    """The drift from the prior pose, by the posterior of an estimate and, maybe, a picture."""
    told = (*fused.identifiable, *(ANGLES if posterior.pictured else ()))
    return drift_between(posterior.parameters, posterior.sd, told, posterior.prior, posterior.move)


def degrees_of_freedom(walking_groups: float | Array) -> Any:
    """Degrees of freedom of an estimate: few groups tell less surely what their covariance is."""
    return config.LEAST_FREEDOM + config.FREEDOM_OF_A_GROUP * walking_groups


def log_prior(moved_prior: float) -> Array:
    """Log prior weights (K,): by itself each, or one angle, all, a far turn, or the scale alone."""
    shares = np.where(_MOVED_IN, config.MOVES_IN, 1 - config.MOVES_IN).prod(axis=1)
    named = config.ALL_SHARE * _ALL + config.SCALE_SHARE * _SCALE
    named += config.JOINT_SHARE / len(ANGLES) * (_ALONE & ~_SCALE)
    rest = 1 - config.ALL_SHARE - config.SCALE_SHARE - config.JOINT_SHARE - config.TURNED_SHARE
    some = rest * shares / (1 - shares[0]) + named
    some = some * np.where(_FAR, config.FAR_SHARE, 1 - config.FAR_SHARE)
    weights = moved_prior * (some + config.TURNED_SHARE * (_PAN & _FAR))
    weights[0] = 1 - moved_prior
    return np.asarray(np.log(weights))


def _at_prior(squared: float, prior_gap: float, walking_groups: int) -> float:
    """The squared distance of a standing camera: by a Gaussian, or by people themselves.

    The covariance is of a Gaussian around the best pose, and the prior pose may be outside of what
    that is good for, either way. What people say of it is at most twice what they lose there in
    the log posterior; and at least that by what people of other hours lose at the true pose.
    """
    if not math.isfinite(prior_gap):
        return squared
    gap = max(prior_gap, 0.0)
    return min(max(squared, gap / times_chance(walking_groups)), gap)


def times_chance(walking_groups: int) -> float:
    """Times chance, that people of other hours lose at the true pose in the log posterior."""
    return config.OTHER_HOURS + config.OTHER_HOURS_OF_A_GROUP * walking_groups


def log_student(squared: Array, scales: Array, degrees: float) -> Array:
    """Log densities (K,) of t's of so many degrees of freedom at squared Mahalanobis distances."""
    size = scales.shape[-1]
    _, log_determinants = np.linalg.slogdet(scales)
    return np.asarray(
        gammaln((degrees + size) / 2)
        - gammaln(degrees / 2)
        - 0.5 * (size * math.log(degrees * math.pi) + log_determinants)
        - log_tail(squared, degrees, size)
    )


def log_tail(squared: Any, degrees: float, size: int = len(PARAMETERS)) -> Any:
    """How much less than at its middle the log density of such a t is at a squared distance."""
    return (degrees + size) / 2 * np.log1p(squared / degrees)


def _quantile(weights: Array, means: Array, sds: Array, share: float) -> float:
    """The quantile of a mixture of normal distributions, by bisection."""
    wide = np.maximum(sds, 1e-12)
    low, high = float((means - 9 * wide).min()), float((means + 9 * wide).max())
    for _ in range(60):
        middle = (low + high) / 2
        below = float(weights @ np.exp(log_ndtr((middle - means) / wide)))
        low, high = (middle, high) if below < share else (low, middle)
    return (low + high) / 2
