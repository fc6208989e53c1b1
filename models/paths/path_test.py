"""The fit test: whether people still walk where they did, wherever the camera looks now.

A camera that moves takes all paths along, and some pose puts people back on them. Where no pose
does, the paths themselves have changed, and the map says nothing true of the camera. From hour to
hour people share the same paths out otherwise: then it says less, and still counts.

Ours: a one-sided t test of the mean over groups of log f - E log f, E by the map over what is seen.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.paths import config
from models.paths.coverage import in_view
from models.paths.ground_steps import place_steps
from models.paths.likelihood import PathModel, Walkers
from models.quantiles import value_below


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualFit:
    """The usual fit of a walking group while paths are as they were: mean, standard deviation."""

    mean: float
    sd: float
    walking_groups: float

    def has_changed(self, fits: Array) -> bool:
        """True if walking groups (P,) fit so much worse that the paths must have changed."""
        if not fits.size:
            return False
        sd = self.sd * float(np.sqrt(1 / fits.size + 1 / self.walking_groups))
        limit = -value_below(config.CHANGED_RATE, self.walking_groups - 1) * sd
        return self._drop(fits) > max(config.NEW_PATHS, limit)

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
