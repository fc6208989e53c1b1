"""The fit test: whether people still walk where they did, wherever the camera looks now.

A camera that moves takes all paths along, and some pose puts people back on them. Where no pose
does, the paths themselves have changed, and the map says nothing true of the camera. From hour to
hour people share the same paths out otherwise: then it says less, and is asked.

Ours: a one-sided t test of the mean over groups of log f - E log f, E by the map over what is seen.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.paths.map.density_map import DIRECTIONS
from models.paths.map.placement import place_steps
from models.paths.map.view import in_view
from models.paths.registration import Site
from models.quantiles import value_below
from models.serialization import stored_as

_RATE = 1e-4  # of windows with unchanged paths that are called changed
# Of the mean log density. By the first an hour differs from another; paths that half of the people
# leave for new ones cost 1.5 and more, and the same paths, other hours, with a map of 1,000 people
# 0.5 at the most (20 simulated sites, 6 cameras of recordings of days).
_TIDE, _NEW_PATHS = 0.35, 1.0
_FEWEST = 5
_KNOWN = 0.5  # of a place's ground must have been seen for it to be asked


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualFit:
    """How well a group fits while the paths are as they were: mean and standard deviation."""

    mean: float
    sd: float
    walking_groups: float = stored_as("parties")

    def has_changed(self, fits: Array) -> bool:
        """Whether walking groups (P,) fit so much worse that the paths must have changed."""
        if not fits.size:
            return False
        sd = self.sd * float(np.sqrt(1 / fits.size + 1 / self.walking_groups))
        limit = -value_below(_RATE, self.walking_groups - 1) * sd
        return self._drop(fits) > max(_NEW_PATHS, limit)

    def variance_inflation(self, fits: Array) -> float:
        """How much larger the map's squared errors are for walking groups (P,) that fit so well."""
        return 1.0 + (max(self._drop(fits), 0.0) / _TIDE) ** 2 if fits.size else 1.0

    def _drop(self, fits: Array) -> float:
        return self.mean - float(fits.mean())


def usual_fit(fits: Array) -> UsualFit:
    """What is usual of the fits (P,) of walking groups to maps that they have no part in."""
    return UsualFit(
        mean=float(fits.mean()), sd=float(fits.std(ddof=1)), walking_groups=float(fits.size)
    )


def group_fits(walkers: Walkers, site: Site, candidate: Array) -> Array:
    """Each walking group's mean log density (P,) on known ground, less what the map itself expects.

    The map's expectation is over what a camera at the candidate (4,) sees, so that a busy view and
    a quiet one compare. Walking groups on ground that the reference did not see are left out.
    """
    fits = _fits(walkers, site, candidate)
    return fits[np.isfinite(fits)]


def loss(walkers: Walkers, site: Site, candidate: Array, other: Array) -> float:
    """How much worse walking groups on known ground fit at another candidate, in standard errors.

    Ground that the reference did not see tells one pose from another by guesses alone. Infinite
    where hardly anybody is on known ground from both.
    """
    apart = _fits(walkers, site, candidate) - _fits(walkers, site, other)
    apart = apart[np.isfinite(apart)]
    if apart.size < _FEWEST:
        return float("inf")
    return float(apart.mean() / max(apart.std(ddof=1) / np.sqrt(apart.size), 1e-9))


def _fits(walkers: Walkers, site: Site, candidate: Array) -> Array:
    """The fit (tracks,) of each walking group at its own index; NaN of those on unknown ground."""
    flow = site.flow
    placed = place_steps(walkers.steps, candidate)
    rows = walkers.steps.rows
    slot_idx = flow.slot_of(rows.time_s)
    value, _, _ = flow.look(placed.place, placed.direction, slot_idx)
    unseen, _ = flow.look_unseen(placed.place)
    fit = value - _expected(site, candidate)[slot_idx]
    asked = placed.valid & (unseen < 1 - _KNOWN)
    walking_groups = walkers.group_idx[rows.owner_idx[asked]]
    weight = walkers.weight[asked]
    total = np.bincount(walking_groups, weight, walkers.tracks)
    sums = np.bincount(walking_groups, weight * fit[asked], walkers.tracks)
    return np.asarray(np.where(total > 0, sums / np.where(total > 0, total, 1.0), np.nan))


def _expected(site: Site, candidate: Array) -> Array:
    """The mean log density (S,) of the map's own people whom a camera at a candidate sees."""
    flow = site.flow
    size = flow.log_density.shape[1:3]
    nodes = flow.corner + flow.cell_m * np.indices(size).reshape(2, -1).T
    seen = in_view(site.intrinsics, candidate, nodes, flow.cell_m)
    seen = seen * (flow.unseen.ravel() < 1 - _KNOWN)
    there = np.flatnonzero(seen)
    log_density = flow.log_density.reshape(flow.slots, -1, DIRECTIONS)[:, there]
    density = np.exp(log_density)
    share = density.sum(axis=2) @ seen[there]
    mean = np.einsum("snw,snw->sn", density, log_density) @ seen[there]
    return np.asarray(mean / np.maximum(share, 1e-9))
