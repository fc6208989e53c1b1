"""Tests of walkers by a site's paths: has the camera moved within a window, have the paths changed?

At the pose where a camera is taken to be, each person's places and directions have a signed score
along tilt, roll, log height and heading: how much likelier they were from a little further on. Of
a still camera the scores are on average what they were in the reference; of one that has moved
they are not, by as much as it has.

A camera that moves takes all paths along, and some pose puts people back on them. Where no pose
does, the paths themselves have changed, and the map says nothing true of the camera. From hour to
hour people share the same paths out otherwise: then it says less, and still counts.

Source: Rao 1948, the score test, of finite steps here; Künsch 1989, the block bootstrap. The fit
test is ours: a one-sided t test of the mean over groups of log f - E log f, E by the map over what
is seen.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array, Index
from models.paths import config
from models.paths.coverage import in_view
from models.paths.ground_steps import place_steps
from models.paths.likelihood import PathModel, Walkers
from models.quantiles import chance_below, value_below


@dataclass(frozen=True, slots=True, kw_only=True)
class StillScores:
    """The scores of a camera that stands: mean (4,) and covariance (4, 4) of a group's.

    `bent` (4, 4) has in a column how the mean moves with each parameter. `looks` is how many
    independent looks at a parameter the test of a window is worth; `walking_groups` made the
    reference.
    """

    mean: Array
    covariance: Array
    bent: Array
    looks: float
    walking_groups: float

    def squares(self, scores: Array) -> Array:
        """The statistics (W, 4) of the newest 8, 9, ... of groups (P, 4), as of `level`."""
        directions, variance = _directions(self.covariance, self.bent)
        along = np.cumsum(((scores - self.mean) @ directions.T)[::-1], axis=0)
        return _squared(along[config.NEWEST_GROUPS - 1 :], variance, self.walking_groups)

    @property
    def information_of_a_group(self) -> Array:
        """The information (4, 4) on a move in the mean score of one group, by paths alone."""
        return np.asarray(self.bent.T @ np.linalg.solve(_ridged(self.covariance), self.bent))

    def level(self, rate: float) -> float:
        """The level that the statistic passes in a share `rate` of windows of a still camera."""
        return value_below(rate / self.looks / 2, self.walking_groups - 1) ** 2


def group_scores(walkers: Walkers, paths: PathModel, at: Array) -> tuple[Array, Index]:
    """The mean scores (P, 4) of each walking group, in the order of their last tracks (P,)."""
    sums, people, last = sums_of_groups(
        walkers, along_paths(walkers, paths, at, np.diag(config.REACH)) / 2
    )
    return sums / people[:, None], last


def along_paths(walkers: Walkers, paths: PathModel, at: Array, steps: Array) -> Array:
    """Gain in log likelihood of tracks (N, S) some steps (S, 4) on against as far back."""
    return gains_along_paths(walkers, paths, at, steps)[0]


def gains_along_paths(
    walkers: Walkers, paths: PathModel, at: Array, steps: Array, busyness: Array | None = None
) -> tuple[Array, Array]:
    """Gains (N, S) as `along_paths`, and the busyness (2 S,) of unseen ground at each pose.

    The busyness is the likeliest for these walkers, unless it is given.
    """
    poses = np.concatenate([at + steps, at - steps])
    values, busyness = paths.values_at(walkers, poses, busyness)
    on, back = np.split(values, 2)
    return np.asarray((on - back).T), busyness


def sums_of_groups(walkers: Walkers, values: Array) -> tuple[Array, Index, Index]:
    """Sums (P, S) of values of tracks (N, S) by walking group, their people, their last tracks."""
    people = np.unique(walkers.steps.rows.owner_idx)
    return sums_by_group(people, walkers.group_idx[people], values[people])


def sums_by_group(people: Index, label: Index, values: Array) -> tuple[Array, Index, Index]:
    """Sums (P, S) of values (N, S) by walking group, the people (P,), the last track (P,) of each.

    `people` (N,) are tracks in the order of their ends, `label` (N,) names the group of each.
    Groups are in the order of their last tracks.
    """
    group_of, last = _in_time(people, label)
    sums = np.zeros((last.size, values.shape[1]))
    np.add.at(sums, group_of, values)
    return sums, np.bincount(group_of, minlength=last.size), last


def _in_time(people: Index, label: Index) -> tuple[Index, Index]:
    """Group (N,) of each of some tracks, and the last track (P,) of each group, rising."""
    labels, group_of = np.unique(label, return_inverse=True)
    last = np.zeros(labels.size, dtype=np.int64)
    np.maximum.at(last, group_of, people)
    rank = np.empty(labels.size, dtype=np.int64)
    rank[np.argsort(last)] = np.arange(labels.size)
    return rank[group_of], np.sort(last)


def learn_scores(scores: Array, bent: Array, seed: int) -> StillScores:
    """The usual scores of a camera that stands, by those (P, 4) of walking groups in time.

    How high the statistic gets is learned by bootstrap: a reference and a window are drawn anew,
    the window some walking groups after one another at a time, and the one is tested by the other.
    So few walking groups in the reference, heavy tails and walking groups that come together all
    raise the level.

    Each is scored by a map that its people have no part in. `bent` (4, 4) is how the mean score
    changes with each parameter, a column for a parameter.
    """
    count = len(scores)
    covariance = np.cov(scores.T)
    directions, variance = _directions(covariance, bent)
    along = scores @ directions.T
    drawn = np.random.default_rng(seed).integers(
        0, count, (config.DRAWS, count + -(-config.MOST_GROUPS // config.BLOCK_GROUPS))
    )
    statistics = np.concatenate(
        [_highest(along, part, variance) for part in np.array_split(drawn, config.PARTS)]
    )
    passed = np.quantile(statistics, 1 - config.BODY)
    alone = 2 * chance_below(-float(np.sqrt(passed)), count - 1)
    return StillScores(
        mean=scores.mean(axis=0),
        covariance=covariance,
        bent=bent,
        looks=max(config.BODY / alone, 4.0),
        walking_groups=float(count),
    )


def moved_within(
    walkers: Walkers, paths: PathModel, at: Array, still: StillScores, rate: float
) -> int | None:
    """The first track after a move that happened among those of a window; None where none did.

    Walking groups before and after are held against one another, so that a camera which has stood
    elsewhere for all of the window is not taken for one that moves again.
    """
    scores, tracks = group_scores(walkers, paths, at)
    if len(scores) < 2 * config.NEWEST_GROUPS:
        return None
    directions, variance = _directions(still.covariance, still.bent)
    along = np.cumsum(scores @ directions.T, axis=0)
    before = np.arange(config.NEWEST_GROUPS, len(scores) - config.NEWEST_GROUPS + 1)[:, None]
    after = len(scores) - before
    first = along[config.NEWEST_GROUPS - 1 : len(scores) - config.NEWEST_GROUPS]
    apart = (along[-1] - first) / after - first / before
    squares = apart**2 / (variance * (1 / before + 1 / after))
    if squares.max() < still.level(rate):
        return None
    walking_groups, _ = np.unravel_index(int(squares.argmax()), squares.shape)
    return int(tracks[int(walking_groups) + config.NEWEST_GROUPS])


def _highest(along: Array, drawn: Index, variance: Array) -> Array:
    """The statistics (D,) of windows of groups whose scores lie (P, 4) along the directions.

    Of P + W indices (D, P + W), the first P are of a reference, the others of where blocks begin.
    """
    groups = len(along)
    usual = along[drawn[:, :groups]].mean(axis=1)[:, None]
    window = (drawn[:, groups:, None] + np.arange(config.BLOCK_GROUPS)) % groups
    sums = np.cumsum((along[window.reshape(len(drawn), -1)] - usual)[:, ::-1], axis=1)
    squares = _squared(sums[:, config.NEWEST_GROUPS - 1 :], variance, groups)
    return np.asarray(squares.max(axis=(1, 2)))


def _squared(sums: Array, variance: Array, walking_groups: float) -> Array:
    """Squared standard scores of sums (..., W, 4) of the newest 8, 9, ... groups."""
    count = np.arange(config.NEWEST_GROUPS, config.NEWEST_GROUPS + sums.shape[-2])[:, None]
    # The map is wrong by as much as its own walking groups' mean is.
    return np.asarray((sums / count) ** 2 / (variance * (1 / count + 1 / walking_groups)))


def _directions(covariance: Array, bent: Array) -> tuple[Array, Array]:
    """Rows (4, 4) to look along, to see each parameter best against the scatter; variances (4,)."""
    ridged = _ridged(covariance)
    directions = np.linalg.solve(ridged, bent).T
    return np.asarray(directions), np.einsum("ki,ij,kj->k", directions, ridged, directions)


def _ridged(covariance: Array) -> Array:
    ridge = config.RIDGE * np.diag(np.diag(covariance))
    return np.asarray(covariance + ridge + 1e-9 * np.eye(4))


FEWEST_USUAL = 2  # groups of which a scatter is known


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualFit:
    """The usual fit of a walking group while paths are as they were: mean, standard deviation."""

    mean: float
    sd: float
    walking_groups: float

    def has_changed(self, fits: Array) -> bool:
        """True if walking groups (P,) fit so much worse that the paths must have changed."""
        if not fits.size or self.walking_groups < FEWEST_USUAL:
            return False
        sd = self.sd * float(np.sqrt(1 / fits.size + 1 / self.walking_groups))
        limit = -value_below(config.CHANGED_RATE, self.walking_groups - 1) * sd
        return self._drop(fits) > max(config.NEW_PATHS, limit)

    def is_doubtful(self, fits: Array) -> bool:
        """True if walking groups (P,) fit worse than other hours' do."""
        return bool(fits.size) and self._drop(fits) > config.TIDE

    def variance_inflation(self, fits: Array) -> float:
        """The inflation of the map's squared errors for walking groups (P,) that fit so well."""
        return 1.0 + (max(self._drop(fits), 0.0) / config.TIDE) ** 2 if fits.size else 1.0

    def _drop(self, fits: Array) -> float:
        return self.mean - float(fits.mean())


def usual_fit(fits: Array) -> UsualFit:
    """The usual fit, by those (P,) of walking groups to maps that they have no part in."""
    return UsualFit(
        mean=float(fits.mean()), sd=float(fits.std(ddof=1)), walking_groups=float(fits.size)
    )


def group_fits(walkers: Walkers, paths: PathModel, candidate: Array) -> Array:
    """Each walking group's mean log density (P,) on seen ground, less what the map itself expects.

    The map's expectation is over what a camera at the candidate (4,) sees, so that a busy view and
    a quiet one compare. Walking groups on ground that the reference did not see are left out.
    """
    fits = _fits(walkers, paths, candidate)
    return fits[np.isfinite(fits)]


def loss(walkers: Walkers, paths: PathModel, candidate: Array, other: Array) -> float:
    """The loss of fit of walking groups on seen ground at another candidate, in standard errors.

    Ground that the reference did not see tells one pose from another by guesses alone. Infinite
    where hardly anybody is on seen ground from both.
    """
    apart = _fits(walkers, paths, candidate) - _fits(walkers, paths, other)
    apart = apart[np.isfinite(apart)]
    if apart.size < config.FEWEST_FITS:
        return float("inf")
    return float(apart.mean() / max(apart.std(ddof=1) / np.sqrt(apart.size), 1e-9))


def _fits(walkers: Walkers, paths: PathModel, candidate: Array) -> Array:
    """The fit (tracks,) of each walking group at its own index; NaN of those on unseen ground."""
    density_map = paths.density
    placed = place_steps(walkers.steps, candidate)
    rows = walkers.steps.rows
    slot_idx = density_map.slot_of(rows.time_s)
    value, _, _ = density_map.log_density_at(placed.place, placed.direction, slot_idx)
    unseen, _ = density_map.unseen_at(placed.place)
    fit = value - _expected(paths, candidate)[slot_idx]
    counted = placed.valid & (unseen < 1 - config.MOSTLY_SEEN)
    walking_groups = walkers.group_idx[rows.owner_idx[counted]]
    weight = walkers.weight[counted]
    total = np.bincount(walking_groups, weight, walkers.tracks)
    sums = np.bincount(walking_groups, weight * fit[counted], walkers.tracks)
    return np.asarray(np.where(total > 0, sums / np.where(total > 0, total, 1.0), np.nan))


def _expected(paths: PathModel, candidate: Array) -> Array:
    """The mean log density (S,) of the map's own people whom a camera at a candidate sees."""
    density_map, ways = paths.density, config.DIRECTIONS
    size = density_map.log_density.shape[1:3]
    nodes = density_map.corner + density_map.cell_m * np.indices(size).reshape(2, -1).T
    seen = in_view(paths.intrinsics, candidate, nodes, density_map.cell_m)
    seen = seen * (density_map.unseen.ravel() < 1 - config.MOSTLY_SEEN)
    there = np.flatnonzero(seen)
    log_density = density_map.log_density.reshape(density_map.slots, -1, ways)[:, there]
    density = np.exp(log_density)
    share = density.sum(axis=2) @ seen[there]
    mean = np.einsum("snw,snw->sn", density, log_density) @ seen[there]
    return np.asarray(mean / np.maximum(share, 1e-9))
