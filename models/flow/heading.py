"""Whether a heading is identifiable: on known ground, and whichever people are asked."""

from dataclasses import replace

import numpy as np

from models.estimation.joint.observations import steps_where
from models.flow.likelihood import Walkers
from models.flow.map.placement import place_steps
from models.flow.registration import Posterior, Site
from models.geometry.rotation import Array, Mask

_AWAY = np.radians(4.0)  # from where a heading was found, both ways, it must be found again
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


def variance_of_halves(posterior: Posterior, candidate: Array, line: Array) -> float:
    """The variance of a heading by how far two halves of the walking groups find it apart.

    Each half begins 4 deg to another side of a candidate (4,), the other parameters following along
    a line (4,): whether it is found from elsewhere, and whether it hangs on a few people, is seen.
    It is of one degree of freedom: for telling that something is wrong, not for an interval.
    """
    ends = [
        replace(posterior, walkers=half).climbed(candidate + away * line).candidate[3]
        for half, away in zip(_halves(posterior.walkers), (_AWAY, -_AWAY), strict=True)
    ]
    return float((ends[0] - ends[1]) / 2) ** 2


def _halves(walkers: Walkers) -> tuple[Walkers, Walkers]:
    """Every other walking group, and the others."""
    _, rank = np.unique(walkers.group_idx[walkers.steps.rows.owner_idx], return_inverse=True)
    first = rank % 2 == 0
    return _part(walkers, first), _part(walkers, ~first)


def _part(walkers: Walkers, kept: Mask) -> Walkers:
    owners = np.unique(walkers.steps.rows.owner_idx[kept])
    return replace(
        walkers,
        steps=steps_where(walkers.steps, kept),
        weight=walkers.weight[kept],
        moments=None if walkers.moments is None else walkers.moments.of_owners(owners),
    )
