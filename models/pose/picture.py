"""A picture's word on what moved, beside the people's: a factor of the posterior.

A picture tells the three angles, never the height; people tell all four, more slowly. Both are of
one pose, unless one of them is not: people may walk elsewhere because the site changed, the camera
may have moved after they walked, and a picture may be matched to the wrong thing.

Ours: p(M | d, t) ~ sum over s of p(s) p(M, d | s) p(t | M, d, s), with d what people say, t what
the picture does, and s which of these holds. Source: Box and Tiao 1968 (observations that may be
wrong), for each hypothesis of `hypotheses`.
"""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.special import logsumexp

from models.errors import ShapeError
from models.geometry.pose import ANGLES, PARAMETERS, CameraPose, array_of
from models.geometry.rotation import Array
from models.pose import config
from models.pose.hypotheses import (
    PosePosterior,
    log_prior,
    log_student,
    move_covariances,
    of_people_who_tell_nothing,
)

# The angles among the parameters.
_AT = [PARAMETERS.index(name) for name in ANGLES]
_HEIGHT = PARAMETERS.index("height")


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureEvidence:
    """How far the camera has turned from its prior pose, by a picture: tilt, roll, heading (3,).

    In radians, with the covariance (3, 3). Where no picture matches, there is no evidence.

    Raises:
        ShapeError: other shapes, numbers that are not finite, or variances that are not above 0.
    """

    offset: Array
    covariance: Array

    def __post_init__(self) -> None:
        if self.offset.shape != (3,) or not np.isfinite(self.offset).all():
            raise ShapeError(f"offset: 3 finite angles are needed, got {self.offset}")
        sound = self.covariance.shape == (3, 3) and np.isfinite(self.covariance).all()
        if not sound or not (np.linalg.eigvalsh(self.covariance) > 0).all():
            raise ShapeError("covariance: 3 x 3 and positive definite is needed")

    @classmethod
    def of_poses(cls, prior: CameraPose, after: CameraPose, covariance: Array) -> Self:
        """That of a camera that stood at the prior pose in the first picture of its gallery.

        `after` is as of `models.pictures.turn.turned_pose`, `covariance` as of `turned_covariance`.

        Raises:
            ShapeError: as of the evidence itself.
        """
        by = (array_of(after) - array_of(prior))[_AT]
        by = np.array([math.remainder(float(angle), 2 * math.pi) for angle in by])
        return cls(offset=by, covariance=covariance)

    @property
    def name(self) -> str:
        """Name of this factor."""
        return "image"

    def updated(self, posterior: PosePosterior, moved_prior: float) -> PosePosterior:
        """The posterior over what moved by the tracks and this image."""
        return with_picture(posterior, self, moved_prior)

    def log_density(self, means: Array, covariances: Array) -> Array:
        """Log densities (K,) of what it says, of a camera that turned about so far.

        `means` (K, 3) are turns in tilt, roll and heading, `covariances` (K, 3, 3) without the
        picture's own.
        """
        scales = covariances + self.covariance
        off = self.offset - means
        squared = np.einsum("ki,kij,kj->k", off, np.linalg.inv(scales), off)
        return log_student(squared, scales, config.PICTURE_FREEDOM)


def with_picture(
    people: PosePosterior, picture: PictureEvidence, moved_prior: float = config.MOVED_PRIOR
) -> PosePosterior:
    """The posterior over what moved by people and a picture.

    The picture is newer than the oldest of the people; `moved_prior` is of before both.
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
    wrong = _log_density_of_anything(picture) + math.log(config.PICTURE_WRONG)
    logs, means, covariances = [], [], []
    for weights, mean, covariance in parts:
        with np.errstate(divide="ignore"):
            log_weights = np.log(weights)
        seen = picture.log_density(mean[:, _AT], covariance[:, _AT][:, :, _AT])
        logs += [log_weights + math.log1p(-config.PICTURE_WRONG) + seen, log_weights + wrong]
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
    """The posterior over what moved by a picture alone, nobody having walked by."""
    return with_picture(of_people_who_tell_nothing(prior, moved_prior), picture, moved_prior)


def _log_density_of_anything(picture: PictureEvidence) -> float:
    """The log density of what a picture says that was matched to the wrong thing."""
    wide = np.diag((config.MOVE_SD * config.FAR_MOVE)[_AT] ** 2)
    return float(picture.log_density(np.zeros((1, 3)), wide[None])[0])


def _updated(means: Array, covariances: Array, picture: PictureEvidence) -> tuple[Array, Array]:
    """Means (K, 4) and covariances (K, 4, 4) after a picture that is right: Kalman's."""
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
