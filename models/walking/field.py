"""The mean of log speed or log stature at a site, by place and direction, and learning it.

m(x, d) = c + a d_x + b d_y + g (d_x^2 - d_y^2) + 2 e d_x d_y + sum_k w_k exp(-|x - x_k|^2 / 2 l^2)
is linear in its coefficients, which have Gaussian priors.

Source: Bishop 2006, Pattern Recognition and Machine Learning, section 3.3, for such regression.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.compiled import compiled
from models.geometry.rotation import Array, Index
from models.serialization import stored_as
from models.walking import config
from models.walking.measures import Measured
from models.walking.mixed_model import (
    Normal,
    VarianceComponents,
    em_step,
    h_log_likelihood,
    regress,
    reweigh,
)

# The squares of Gaussian bumps one length apart sum to pi, wherever one looks.
_BUMP_SHARE = np.pi
_FIELD_SETTLED = 1e-4  # of a log at any row
_NO_DIRECTION, _NO_CHANGE = np.empty((0, 2)), np.empty((0, 2, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldShape:
    """A field's prior: how much it may vary by place (over a length), by direction, and as a whole.

    All are standard deviations of a logarithm.
    """

    level: float
    level_sd: float
    length_m: float
    place_sd: float
    direction_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """A linear model of the mean: a level, four directions, and bumps exp(-|x - x_k|^2 / 2 l^2).

    The bumps are of one length, centred at (K, 2) on a square grid. A field without directions has
    a level and bumps only. A prior variance for each of its P coefficients is in `prior_variance`
    (P,); `prior_mean` (P,) is the level and zeros.
    """

    centres: Array
    length_m: float
    directional: bool
    prior_mean: Array
    prior_variance: Array

    def scaled(self, share: float) -> "Field":
        """The same field with a share of its prior's standard deviations, but for the level's."""
        variance = self.prior_variance * share**2
        variance[0] = self.prior_variance[0]
        return replace(self, prior_variance=variance)

    def level_alone(self) -> "Field":
        """A field that is the same everywhere and in every direction."""
        mean, variance = self.prior_mean[:1], self.prior_variance[:1]
        return Field(
            centres=np.empty((0, 2)),
            length_m=self.length_m,
            directional=False,
            prior_mean=mean,
            prior_variance=variance,
        )

    def features(self, measured: Measured) -> Array:
        """The rows (M, P) that coefficients are multiplied by: 1, four of directions, the bumps."""
        exponents, pair = exponents_at(measured.place, self.centres, self.length_m)
        falls = np.exp(exponents, out=exponents)
        direction = measured.direction if self.directional else _NO_DIRECTION
        assert direction is not None
        return features_of(falls, pair, self.directional, direction)

    def slopes(self, measured: Measured, features: Array, coefficients: Array) -> Array:
        """Derivatives (M, 3) of the mean at each row by tilt, roll, log height."""
        first = 5 if self.directional else 1
        # Three products with a vector take half as long as one with a matrix of three columns.
        pulls = np.zeros((3, features.shape[1]))
        pulls[:2, first:] = coefficients[first:] * self.centres.T
        pulls[2, first:] = coefficients[first:]
        direction, d_direction = _NO_DIRECTION, _NO_CHANGE
        if self.directional:
            assert measured.direction is not None
            assert measured.d_direction is not None
            direction, d_direction = measured.direction, measured.d_direction
        return slopes_of(
            features @ pulls[0],
            features @ pulls[1],
            features @ pulls[2],
            self.length_m,
            measured.place,
            measured.d_place,
            coefficients,
            self.directional,
            direction,
            d_direction,
        )


def field_over(measured: Measured, shape: FieldShape) -> Field:
    """An unlearned field over the ground where something was measured.

    Bumps stand on a square grid one length apart; where a site would need more than 150 of them,
    the length grows until it does not.
    """
    places = measured.place[measured.valid]
    length_m = shape.length_m
    centres = _centres(places, length_m)
    while len(centres) > config.MOST_BUMPS:
        length_m *= 1.25
        centres = _centres(places, length_m)
    directional = measured.direction is not None
    variances = [
        np.array([shape.level_sd**2]),
        np.full(4 if directional else 0, shape.direction_sd**2),
        np.full(len(centres), shape.place_sd**2 / _BUMP_SHARE),
    ]
    variance = np.concatenate(variances)
    mean = np.zeros(variance.size)
    mean[0] = shape.level
    return Field(
        centres=centres,
        length_m=length_m,
        directional=directional,
        prior_mean=mean,
        prior_variance=variance,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """A field with the mean (P,) and covariance (P, P) of its coefficients.

    `components` are of variance; `usual` is the field's mean over all that it was learned of.
    """

    field: Field
    mean: Array
    covariance: Array
    components: VarianceComponents = stored_as("spread")
    usual: float


def assumed(field: Field, components: VarianceComponents) -> Learned:
    """A field that nothing has been learned of yet."""
    return Learned(
        field=field,
        mean=field.prior_mean,
        covariance=np.diag(field.prior_variance),
        components=components,
        usual=float(field.prior_mean[0]),
    )


def learn(measured: Measured, start: Learned, *, em_rounds: int) -> Learned:
    """The field and the components that explain what was measured at a known pose.

    The components are learned in so many rounds of EM; with 0 they are taken as given.
    """
    features, components = start.field.features(measured), start.components
    prior = Normal(mean=start.mean, covariance=start.covariance)
    found = prior
    for round_ in range(em_rounds + 1):
        found, weights = regress(
            features, measured, components, prior, found.mean,
            lambda move: bool(np.abs(features @ move).max(initial=0.0) < _FIELD_SETTLED),
        )  # fmt: skip
        if round_ < em_rounds:
            residual = measured.value - features @ found.mean
            components = em_step(residual, measured, weights, components)
    inlier = weights.inlier
    return Learned(
        field=start.field,
        mean=found.mean,
        covariance=found.covariance,
        components=components,
        usual=float((inlier * (features @ found.mean)).sum() / max(float(inlier.sum()), 1e-9)),
    )


def held_out_log_likelihood(measured: Measured, learned: Learned) -> float:
    """The log likelihood, by a learned field, of what other tracks measured at the same pose."""
    residual = measured.value - learned.field.features(measured) @ learned.mean
    residual = np.where(measured.valid, residual, 0.0)
    weights = reweigh(residual, measured, learned.components)
    return h_log_likelihood(residual, weights, measured.rows, learned.components)


def _centres(places: Array, length_m: float) -> Array:
    """Grid points (K, 2) that have a measured place within one length."""
    if not len(places):
        return np.empty((0, 2))
    low, high = (np.quantile(places, share, axis=0) for share in (0.01, 0.99))
    inside = ((places >= low) & (places <= high)).all(axis=1)
    kept = places[inside] if inside.any() else places
    cells = np.unique(np.round(kept / length_m).astype(np.int64), axis=0)
    around = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    grid = np.unique((cells[:, None] + around).reshape(-1, 2), axis=0) * length_m
    apart = np.linalg.norm(grid[:, None] - kept[:: max(1, len(kept) // 2000)], axis=-1)
    return np.asarray(grid[apart.min(axis=1) < length_m])


@compiled
def exponents_at(place: Array, centres: Array, length_m: float) -> tuple[Array, Index]:
    """Logarithms (M, L) of bumps of x or y alone, and which two (K, 2) make each bump.

    A bump is one of x times one of y, and centres (K, 2) on a grid share their x and y: there are
    fewer exponentials than bumps.
    """
    bumps = len(centres)
    pair, middles = np.empty((bumps, 2), dtype=np.int64), np.empty(2 * bumps)
    axes: list[int] = []
    for axis in range(2):
        begin = len(axes)
        for k in range(bumps):
            found = begin
            while found < len(axes) and middles[found] != centres[k, axis]:
                found += 1
            if found == len(axes):
                middles[found] = centres[k, axis]
                axes.append(axis)
            pair[k, axis] = found
    exponents, fall = np.empty((len(place), len(axes))), -1 / (2 * length_m**2)
    for j in range(len(place)):
        for line, axis in enumerate(axes):
            apart = place[j, axis] - middles[line]
            exponents[j, line] = apart * apart * fall
    return exponents, pair


@compiled
def features_of(falls: Array, pair: Index, directional: bool, direction: Array) -> Array:
    """A field's features (M, P): 1, four of the direction where it has any, and K bumps.

    `falls` (M, L) are bumps of x or y alone, `pair` (K, 2) the two that make each bump.
    """
    first = 5 if directional else 1
    features = np.empty((len(falls), first + len(pair)))
    for j in range(len(falls)):
        row, fall = features[j], falls[j]
        row[0] = 1.0
        if directional:
            x, y = direction[j]
            row[1], row[2], row[3], row[4] = x, y, x * x - y * y, 2 * x * y
        for k in range(len(pair)):
            row[first + k] = fall[pair[k, 0]] * fall[pair[k, 1]]
    return features


@compiled
def slopes_of(
    east: Array,
    north: Array,
    total: Array,
    length_m: float,
    place: Array,
    d_place: Array,
    coefficients: Array,
    directional: bool,
    direction: Array,
    d_direction: Array,
) -> Array:
    """Derivatives (M, 3) of a field's mean by tilt, roll, log height.

    `east`, `north` and `total` (M,) are sums of bumps times their coefficients and their centres'
    x, y and 1; `d_place` and `d_direction` (M, 2, 3) are derivatives of `place` and `direction`.
    """
    slopes = np.empty((len(place), 3))
    for j in range(len(place)):
        by_x = (east[j] - total[j] * place[j, 0]) / length_m**2
        by_y = (north[j] - total[j] * place[j, 1]) / length_m**2
        for number in range(3):
            slopes[j, number] = by_x * d_place[j, 0, number] + by_y * d_place[j, 1, number]
        if directional:
            x, y = direction[j]
            a, b, c, d = coefficients[1], coefficients[2], coefficients[3], coefficients[4]
            by_x, by_y = a + 2 * (c * x + d * y), b + 2 * (d * x - c * y)
            for number in range(3):
                slopes[j, number] += (
                    by_x * d_direction[j, 0, number] + by_y * d_direction[j, 1, number]
                )
    return slopes
