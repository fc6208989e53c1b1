"""Scores of walking groups by where they walk, and the first of them after a move within a window.

At the pose where a camera is taken to be, each person's places and directions have a signed score
along tilt, roll, log height and heading: how much likelier they were from a little further on. Of
a still camera the scores are on average what they were in the reference; of one that has moved
they are not, by as much as it has.

Source: Rao 1948, the score test, of finite steps here; Künsch 1989, the block bootstrap.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.paths.registration import Site
from models.quantiles import chance_below, value_below
from models.serialization import stored_as

# How far both ways a score looks: radians, log height. The map is smoothed by about as much.
REACH = np.array([np.radians(3), np.radians(3), 0.08, np.radians(4)])
_FEWEST = 8  # walking groups that a move is detected by
_MOST = 300
_BLOCK = 3  # walking groups after one another that the bootstrap keeps together
_DRAWS = 1500
_PARTS = 30  # of these, each small enough to stay near the processor
_RIDGE = 0.02  # of each score's variance is its own, so that no direction is too good
_BODY = 0.05  # the share of draws at which looks are counted; beyond, Student's tail is theirs


@dataclass(frozen=True, slots=True, kw_only=True)
class StillScores:
    """What scores are like while a camera stands: mean (4,) and covariance (4, 4) of a group's.

    `bent` (4, 4) has in a column how the mean moves with each parameter. `looks` is how many
    independent looks at a parameter the test of a window is worth; `walking_groups` made the
    reference.
    """

    mean: Array
    covariance: Array
    bent: Array
    looks: float
    walking_groups: float = stored_as("parties")

    def squares(self, scores: Array) -> Array:
        """What is compared with `level`, (W, 4): of the newest 8, 9, ... of groups (P, 4)."""
        along = _directions(self.covariance, self.bent)
        return _squares(scores, self.mean, *along, self.walking_groups)

    @property
    def information_of_a_group(self) -> Array:
        """How much (4, 4) the mean score of one group tells of a move, were paths all it told."""
        ridge = self.covariance + _RIDGE * np.diag(np.diag(self.covariance)) + 1e-9 * np.eye(4)
        return np.asarray(self.bent.T @ np.linalg.solve(ridge, self.bent))

    def level(self, rate: float) -> float:
        """What the statistic passes in a share `rate` of windows of a still camera."""
        return value_below(rate / self.looks / 2, self.walking_groups - 1) ** 2


def group_scores(walkers: Walkers, site: Site, at: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """The mean scores (P, 4) of each walking group, in the order of their last tracks (P,)."""
    scores = along_paths(walkers, site, at, np.diag(REACH))
    people, group_of, last = groups_in_time(walkers)
    sums = np.zeros((last.size, 4))
    np.add.at(sums, group_of, scores[people] / 2)
    return sums / np.bincount(group_of)[:, None], last


def along_paths(walkers: Walkers, site: Site, at: Array, steps: Array) -> Array:
    """How much likelier tracks (N, S) are some steps (S, 4) on than as far back."""
    on, back = np.split(
        site.track_log_likelihoods(walkers, np.concatenate([at + steps, at - steps])), 2
    )
    return np.asarray((on - back).T)


def groups_in_time(
    walkers: Walkers,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Tracks with a step (N,), the group (N,) of each, and each group's last track (P,), rising."""
    people = np.unique(walkers.steps.rows.owner_idx)
    labels, group_of = np.unique(walkers.group_idx[people], return_inverse=True)
    last = np.zeros(labels.size, dtype=np.int64)
    np.maximum.at(last, group_of, people)
    rank = np.empty(labels.size, dtype=np.int64)
    rank[np.argsort(last)] = np.arange(labels.size)
    return people, rank[group_of], np.sort(last)


def learn_scores(scores: Array, bent: Array, seed: int) -> StillScores:
    """What is usual of the scores (P, 4) of walking groups, in the order of time.

    How high the statistic gets is learned by bootstrap: a reference and a window are drawn anew,
    the window some walking groups after one another at a time, and the one is tested by the other.
    So few walking groups in the reference, heavy tails and walking groups that come together all
    raise the level.

    Args:
        scores: each scored by a map that its people have no part in.
        bent: how the mean score changes with each parameter (4, 4): a column for a parameter.
        seed: of the bootstrap.
    """
    count = len(scores)
    covariance = np.cov(scores.T)
    directions, variance = _directions(covariance, bent)
    along = scores @ directions.T
    drawn = np.random.default_rng(seed).integers(0, count, (_DRAWS, count + -(-_MOST // _BLOCK)))
    statistics = np.concatenate(
        [_highest(along, part, variance) for part in np.array_split(drawn, _PARTS)]
    )
    passed = np.quantile(statistics, 1 - _BODY)
    alone = 2 * chance_below(-float(np.sqrt(passed)), count - 1)
    return StillScores(
        mean=scores.mean(axis=0),
        covariance=covariance,
        bent=bent,
        looks=max(_BODY / alone, 4.0),
        walking_groups=float(count),
    )


def moved_within(
    walkers: Walkers, site: Site, at: Array, still: StillScores, rate: float
) -> int | None:
    """The first track after a move that happened among those of a window; None where none did.

    Walking groups before and after are held against one another, so that a camera which has stood
    elsewhere for all of the window is not taken for one that moves again.
    """
    scores, tracks = group_scores(walkers, site, at)
    if len(scores) < 2 * _FEWEST:
        return None
    directions, variance = _directions(still.covariance, still.bent)
    along = np.cumsum(scores @ directions.T, axis=0)
    before = np.arange(_FEWEST, len(scores) - _FEWEST + 1)[:, None]
    after = len(scores) - before
    first = along[_FEWEST - 1 : len(scores) - _FEWEST]
    apart = (along[-1] - first) / after - first / before
    squares = apart**2 / (variance * (1 / before + 1 / after))
    if squares.max() < still.level(rate):
        return None
    walking_groups, _ = np.unravel_index(int(squares.argmax()), squares.shape)
    return int(tracks[int(walking_groups) + _FEWEST])


def _highest(along: Array, drawn: npt.NDArray[np.int64], variance: Array) -> Array:
    """The statistics (D,) of windows of groups whose scores lie (P, 4) along the directions.

    Of P + W indices (D, P + W), the first P are of a reference, the others of where blocks begin.
    """
    groups = len(along)
    usual = along[drawn[:, :groups]].mean(axis=1)[:, None]
    window = (drawn[:, groups:, None] + np.arange(_BLOCK)) % groups
    sums = np.cumsum((along[window.reshape(len(drawn), -1)] - usual)[:, ::-1], axis=1)
    return np.asarray(_squared(sums[:, _FEWEST - 1 :], variance, groups).max(axis=(1, 2)))


def _squares(
    scores: Array, mean: Array, directions: Array, variance: Array, walking_groups: float
) -> Array:
    """Squared standard scores (W, 4) of the newest 8, 9, ... groups' means, for each parameter."""
    along = np.cumsum(((scores - mean) @ directions.T)[::-1], axis=0)[_FEWEST - 1 :]
    return _squared(along, variance, walking_groups)


def _squared(sums: Array, variance: Array, walking_groups: float) -> Array:
    """Squared standard scores of sums (..., W, 4) of the newest 8, 9, ... groups."""
    count = np.arange(_FEWEST, _FEWEST + sums.shape[-2])[:, None]
    # The map is wrong by as much as its own walking groups' mean is.
    return np.asarray((sums / count) ** 2 / (variance * (1 / count + 1 / walking_groups)))


def _directions(covariance: Array, bent: Array) -> tuple[Array, Array]:
    """Rows (4, 4) to look along, to see each parameter best against the scatter; variances (4,)."""
    ridge = covariance + _RIDGE * np.diag(np.diag(covariance)) + 1e-9 * np.eye(4)
    directions = np.linalg.solve(ridge, bent).T
    return np.asarray(directions), np.einsum("ki,ij,kj->k", directions, ridge, directions)
