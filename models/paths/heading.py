"""Tests of a heading: on seen ground, and whichever people are taken."""

from dataclasses import replace

import numpy as np

from models.geometry.rotation import Array, Mask
from models.paths.config import ABOUT, AWAY_RAD, CONVERGED, MOSTLY_SEEN
from models.paths.ground_steps import place_steps
from models.paths.likelihood import PathModel, Walkers
from models.paths.registration import Posterior
from models.tracks.observations import steps_where


def on_seen_ground(walkers: Walkers, paths: PathModel, candidate: Array) -> bool:
    """True if most of what people do, from a candidate (4,), is on ground the reference saw."""
    placed = place_steps(walkers.steps, candidate)
    unseen, _ = paths.density.unseen_at(placed.place)
    seen = float((walkers.weight * placed.valid * (1 - unseen)).sum())
    return seen / max(float(walkers.weight.sum()), 1e-12) >= MOSTLY_SEEN


def variance_of_halves(
    posterior: Posterior, candidate: Array, line: Array, *, afar: bool = True
) -> float:
    """The variance of a heading by how far two halves of the walking groups find it apart.

    Each half begins 4 deg to another side of a candidate (4,), the other parameters following along
    a line (4,): whether it is found from elsewhere, and whether it hangs on a few people, is seen.
    Not `afar` both begin at the candidate and go about as far as they would, for people of whom
    most began elsewhere before. It is of one degree of freedom: for telling that
    something is wrong, and not for an interval.
    """
    sides, least_gain = ((AWAY_RAD, -AWAY_RAD), CONVERGED) if afar else ((0.0, 0.0), ABOUT)
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
