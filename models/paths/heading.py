"""Whether a heading is identifiable: on known ground, and whichever people are asked."""

from dataclasses import replace

import numpy as np

from models.geometry.rotation import Array, Mask
from models.paths.likelihood import Walkers
from models.paths.map.placement import place_steps
from models.paths.registration import CONVERGED, Posterior, Site
from models.tracks.observations import steps_where

_AWAY = np.radians(4.0)  # from where a heading was found, both ways, it must be found again
_ABOUT = 0.03  # of the log posterior: a quarter of a standard deviation
_MOST = 0.5  # of the people must walk where the reference did see


def known_share(walkers: Walkers, site: Site, candidate: Array) -> float:
    """Which share of what people do is on ground that the reference saw, from a candidate (4,)."""
    placed = place_steps(walkers.steps, candidate)
    unseen, _ = site.flow.look_unseen(placed.place)
    weight = walkers.weight * placed.valid
    return float((weight * (1 - unseen)).sum() / max(float(walkers.weight.sum()), 1e-12))


def on_known_ground(walkers: Walkers, site: Site, candidate: Array) -> bool:
    """Whether most people are."""
    return known_share(walkers, site, candidate) >= _MOST


def variance_of_halves(
    posterior: Posterior, candidate: Array, line: Array, *, afar: bool = True
) -> float:
    """The variance of a heading by how far two halves of the walking groups find it apart.

    Each half begins 4 deg to another side of a candidate (4,), the other parameters following along
    a line (4,): whether it is found from elsewhere, and whether it hangs on a few people, is seen.
    Not `afar` both begin at the candidate and go about as far as they would, for people of whom
    most were asked from elsewhere before. It is of one degree of freedom: for telling that
    something is wrong, and not for an interval.
    """
    sides, least_gain = ((_AWAY, -_AWAY), CONVERGED) if afar else ((0.0, 0.0), _ABOUT)
    ends = [
        replace(posterior, walkers=half).climbed(candidate + away * line, least_gain).candidate[3]
        for half, away in zip(_halves(posterior.walkers), sides, strict=True)
    ]
    return float((ends[0] - ends[1]) / 2) ** 2


def _halves(walkers: Walkers) -> tuple[Walkers, Walkers]:
    """Every other walking group, and the others."""
    _, rank = np.unique(walkers.group_idx[walkers.steps.rows.owner_idx], return_inverse=True)
    first = rank % 2 == 0
    return _part(walkers, first), _part(walkers, ~first)


def _part(walkers: Walkers, kept: Mask) -> Walkers:
    return replace(walkers, steps=steps_where(walkers.steps, kept), weight=walkers.weight[kept])
