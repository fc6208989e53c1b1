"""The evidence of images on what moved, beside the people's: a factor of the posterior.

Images determine the three angles and never the height; tracks determine all four, more slowly.
Both are of one pose, with three exceptions: the site changed and people walk elsewhere, the camera
moved after they walked, or an image is matched to the wrong thing.

Ours: p(M | d, t) ~ sum over s of p(s) p(M, d | s) p(t | M, d, s), with d the estimate from tracks,
t the turn by images, and s the case. Source: Box and Tiao 1968 (observations that may be wrong),
for each hypothesis of `hypotheses`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Self

import numpy as np
from scipy.special import logsumexp

from models.errors import ShapeError
from models.geometry.pose import ANGLES, PARAMETERS, CameraPose, array_of
from models.geometry.rotation import Array
from models.monitoring.drift import Drift, drift_between
from models.pose import config
from models.pose.hypotheses import (
    PosePosterior,
    log_prior,
    log_student,
    move_covariances,
    of_people_who_tell_nothing,
)
from models.quantiles import chi_squared_above

# The angles among the parameters.
_AT = [PARAMETERS.index(name) for name in ANGLES]
_HEIGHT = PARAMETERS.index("height")


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureEvidence:
    """The turn of a camera from its prior pose by images: tilt, roll, heading (3,) in radians.

    `covariance` (3, 3) is without outliers. Errors are of a Student's t with `freedom` degrees,
    or, with the probability `wrong`, of a match to something else. An image that does not match
    is no evidence.

    Raises:
        ShapeError: other shapes, numbers that are not finite, variances that are not above 0,
            a `freedom` that is not above 2, or a `wrong` outside 0 to 1.
    """

    offset: Array
    covariance: Array
    freedom: float
    wrong: float

    def __post_init__(self) -> None:
        if self.offset.shape != (3,) or not np.isfinite(self.offset).all():
            raise ShapeError(f"offset: 3 finite angles are needed, got {self.offset}")
        sound = self.covariance.shape == (3, 3) and np.isfinite(self.covariance).all()
        if not sound or not (np.linalg.eigvalsh(self.covariance) > 0).all():
            raise ShapeError("covariance: 3 x 3 and positive definite is needed")
        if not self.freedom > 2:
            raise ShapeError(f"freedom: more than 2 degrees are needed, got {self.freedom:g}")
        if not 0 <= self.wrong <= 1:
            raise ShapeError(f"wrong: a probability is needed, got {self.wrong:g}")

    @classmethod
    def of_match(cls, offset: Array, covariance: Array, inliers: int) -> Self:
        """The evidence of one image that matched with so many inliers.

        Raises:
            ShapeError: as of the evidence itself.
        """
        more = max(inliers - config.FEWEST_MATCHED, 0)
        by_chance = config.WRONG_OF_FEWEST * 10 ** (-more / config.INLIERS_OF_A_TENTH)
        return cls(
            offset=offset,
            covariance=covariance,
            freedom=config.LEAST_IMAGE_FREEDOM + inliers / config.INLIERS_OF_A_DEGREE,
            wrong=config.WRONG_OF_MANY + by_chance,
        )

    def agrees_with(self, other: Self) -> bool:
        """True if both may be of one pose, between sways of the bracket."""
        apart = self.offset - other.offset
        scale = self.covariance + other.covariance + 2 * np.diag(config.REST_SD[_AT] ** 2)
        squared = float(apart @ np.linalg.solve(scale, apart))
        return squared < chi_squared_above(config.AGREE_BY_CHANCE, len(_AT))

    @property
    def name(self) -> str:
        """Name of this factor."""
        return "image"

    def updated(self, posterior: PosePosterior, moved_prior: float) -> PosePosterior:
        """The posterior over what moved by the tracks and this image."""
        return with_picture(posterior, self, moved_prior)

    def log_density(self, means: Array, covariances: Array) -> Array:
        """Log densities (K,) of the offset, by hypotheses of which turns the camera made.

        `means` (K, 3) are turns in tilt, roll and heading, `covariances` (K, 3, 3) without the
        image's own.
        """
        scales = covariances + self.covariance
        off = self.offset - means
        squared = np.einsum("ki,kij,kj->k", off, np.linalg.inv(scales), off)
        return log_student(squared, scales, self.freedom)


def turn_by_pose(prior: CameraPose, after: CameraPose) -> Array:
    """The turn (3,) in tilt, roll and heading from one pose to another, the short way round.

    `after` is as of `models.pictures.turn.turned_pose`.
    """
    by = (array_of(after) - array_of(prior))[_AT]
    return np.array([math.remainder(float(angle), 2 * math.pi) for angle in by])


def of_agreeing(images: Sequence[PictureEvidence]) -> PictureEvidence:
    """The evidence of the newest image and of those before it that agree with it.

    `images` are independent ones, the newest first; the first that does not agree is of before a
    move, and ends them. Independent errors average out, and for all of them to be far off, each has
    to be: as the tails of t's multiply, degrees of freedom add up, and so do logs of the chances of
    wrong matches. Errors in common bound that: `config.COMMON_VARIANCE`, `config.WRONG_OF_ALL`.
    """
    newest = images[0]
    together = list(takewhile(newest.agrees_with, images))
    if len(together) == 1:
        return newest
    precisions = [np.linalg.inv(each.covariance) for each in together]
    independent = np.linalg.inv(sum(precisions))
    pulls = [p @ each.offset for p, each in zip(precisions, together, strict=True)]
    best = min(together, key=lambda each: float(np.trace(each.covariance)))
    common = config.COMMON_VARIANCE
    return PictureEvidence(
        offset=independent @ sum(pulls),
        covariance=common * best.covariance + (1 - common) * independent,
        freedom=sum(each.freedom for each in together),
        wrong=min(config.WRONG_OF_ALL + math.prod(each.wrong for each in together), newest.wrong),
    )


def with_picture(
    people: PosePosterior, picture: PictureEvidence, moved_prior: float = config.MOVED_PRIOR
) -> PosePosterior:
    """The posterior over what moved, by tracks and images.

    The newest image is newer than the oldest track; `moved_prior` is of before both.
    """
    prior = np.exp(log_prior(moved_prior))
    moves = move_covariances() + np.diag(config.REST_SD**2)
    nothing = np.zeros_like(people.means)
    elsewhere = people.weights[1:].sum() / moved_prior  # by people who walk wherever they like
    since = np.where(np.arange(len(prior)) > 0, prior / moved_prior, 0.0)
    told = 1 - config.SITE_CHANGES - config.MOVED_SINCE
    parts = [
        (told * people.weights, people.means, people.covariances),
        (config.SITE_CHANGES * elsewhere * prior, nothing, moves),
        (config.MOVED_SINCE * people.weights[0] * since, nothing, moves),
    ]
    wrong = _log_density_of_anything(picture) + math.log(max(picture.wrong, 1e-300))
    logs, means, covariances = [], [], []
    for weights, mean, covariance in parts:
        with np.errstate(divide="ignore"):
            log_weights = np.log(weights)
        seen = picture.log_density(mean[:, _AT], covariance[:, _AT][:, :, _AT])
        logs += [log_weights + math.log1p(-picture.wrong) + seen, log_weights + wrong]
        better, surer = _updated(mean, covariance, picture)
        means += [better, mean]
        covariances += [surer, covariance]
    shares = np.stack(logs)
    shares = np.exp(shares - logsumexp(shares))
    weights = shares.sum(axis=0)
    mean, covariance = _mixed(shares, np.stack(means), np.stack(covariances))
    return replace(
        people,
        weights=weights,
        means=mean,
        covariances=covariance,
        seen=people.seen | (np.arange(len(PARAMETERS)) != _HEIGHT),
        pictured=float(shares[::2].sum()) >= config.PICTURED,
        site_changed=float(shares[2:4].sum()),
    )


def posterior_by_picture(
    prior: CameraPose, picture: PictureEvidence, moved_prior: float = config.MOVED_PRIOR
) -> PosePosterior:
    """The posterior over what moved by images alone, without tracks."""
    return with_picture(of_people_who_tell_nothing(prior, moved_prior), picture, moved_prior)


def drift_by_images(posterior: PosePosterior) -> Drift:
    """The drift by images alone: of the angles."""
    return drift_between(
        posterior.parameters, posterior.sd, ANGLES, posterior.prior, posterior.move
    )


def _log_density_of_anything(picture: PictureEvidence) -> float:
    """The log density of the turn by a match to the wrong thing."""
    wide = np.diag((config.MOVE_SD * config.FAR_MOVE)[_AT] ** 2)
    return float(picture.log_density(np.zeros((1, 3)), wide[None])[0])


def _updated(means: Array, covariances: Array, picture: PictureEvidence) -> tuple[Array, Array]:
    """Means (K, 4) and covariances (K, 4, 4) after a right match: Kalman's."""
    scales = covariances[:, _AT][:, :, _AT] + picture.covariance
    gains = np.linalg.solve(scales, covariances[:, _AT]).transpose(0, 2, 1)
    better = means + np.einsum("kij,kj->ki", gains, picture.offset - means[:, _AT])
    return better, covariances - gains @ covariances[:, _AT]


def _mixed(shares: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Means (K, 4) and covariances (K, 4, 4) of mixtures of some (S, K), by their moments."""
    whole = shares.sum(axis=0)
    even = np.full_like(shares, 1 / len(shares))
    own = np.where(whole > 0, shares / np.where(whole > 0, whole, 1.0), even)
    mean = np.einsum("sk,ski->ki", own, means)
    apart = means - mean
    between = np.einsum("sk,ski,skj->kij", own, apart, apart)
    return mean, np.einsum("sk,skij->kij", own, covariances) + between
