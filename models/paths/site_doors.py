"""From walkers at a known pose to doors that others can be registered to, where doors help."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.doors.choosing import Part, best_door_grain, doors_of
from models.doors.door_map import DoorGrain, Nodes
from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.paths.registration import Site, curvature_of
from models.paths.turn_detection import groups_in_time

_NODES_A_CELL = 2  # doors are narrower than paths
# Of the doors' log likelihood against the steps', whose own weight is a convention. More than all
# of it would trust a rough map of few people for how much its likelihood bends.
_WEIGHTS = (0.5, 1.0)
_SURER = 0.2  # of the log determinant of the information: 2.5 % of each standard deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class Quarter:
    """Walkers that a site's map was made of, each counted by its weight, and others left out."""

    known: Walkers
    weights: Array
    asked: Walkers
    site: Site


def with_doors(
    site: Site, walkers: Walkers, weights: Array, at: Array, grain: DoorGrain | None
) -> Site:
    """A site with the doors of walkers seen from a known pose (4,); as it is without a grain.

    Args:
        site: the map of these walkers.
        walkers: to learn the doors of.
        weights: what each track (tracks,) counts for.
        at: the known pose (4,).
        grain: of the doors.
    """
    if grain is None or walkers.moments is None:
        return site
    return replace(site, doors=doors_of(walkers.moments, weights, at, _nodes_of(site), grain))


def with_quarters_doors(
    quarters: Sequence[Quarter], at: Array, grain: DoorGrain | None
) -> tuple[Site, ...]:
    """The quarters' sites with their doors of a grain; as they are without one."""
    return tuple(with_doors(own.site, own.known, own.weights, at, grain) for own in quarters)


def door_grain(quarters: Sequence[Quarter], at: Array) -> tuple[DoorGrain | None, tuple[Site, ...]]:
    """The grain of doors that help, and the quarters' sites with these; None where none do.

    They do where they clearly predict where the people left out begin and end, and make the
    pose that is told by these surer, at the weight that makes it surest.

    Source: Lindsay, Yi and Sun 2011, weights of a composite likelihood by Godambe's information.

    Args:
        quarters: of the people.
        at: the known pose (4,).
    """
    parts = [
        Part(
            known=quarter.known.moments,
            weights=quarter.weights,
            asked=quarter.asked.moments,
            group_idx=quarter.asked.group_idx,
            nodes=_nodes_of(quarter.site),
        )
        for quarter in quarters
        if quarter.known.moments is not None and quarter.asked.moments is not None
    ]
    surest, sites = None, tuple(quarter.site for quarter in quarters)
    if not parts or len(parts) < len(quarters):
        return surest, sites
    grain = best_door_grain(parts, at)
    if grain is None:
        return surest, sites
    asked = [quarter.asked for quarter in quarters]
    every = with_quarters_doors(quarters, at, grain)
    most = _log_information(sites, asked, at) + _SURER
    for weight in _WEIGHTS:
        weighed = tuple(_weighed(site, weight) for site in every)
        information = _log_information(weighed, asked, at)
        if information > most:
            surest, sites, most = replace(grain, weight=weight), weighed, information
    return surest, sites


def _weighed(site: Site, weight: float) -> Site:
    """A site whose doors count for so much."""
    return replace(site, doors=None if site.doors is None else replace(site.doors, weight=weight))


def _log_information(sites: Sequence[Site], asked: Sequence[Walkers], at: Array) -> float:
    """The log determinant of what walkers tell of a pose, by maps that they have no part of.

    Source: Godambe 1960, H J^-1 H, with J by walking groups.
    """
    curvature = np.zeros((4, 4))
    slopes = []
    for site, walkers in zip(sites, asked, strict=True):
        scores = site.scores(walkers, at, at)
        people, group_of, last = groups_in_time(walkers)
        sums = np.zeros((last.size, 4))
        np.add.at(sums, group_of, scores[people])
        slopes.append(sums)
        curvature += curvature_of(walkers, site, at)
    every = np.concatenate(slopes)
    centred = every - every.mean(axis=0)
    return float(2 * np.linalg.slogdet(curvature)[1] - np.linalg.slogdet(centred.T @ centred)[1])


def _nodes_of(site: Site) -> Nodes:
    """Twice as many to a side as the site's map has, over the same ground."""
    columns, rows = site.flow.unseen.shape
    return Nodes(
        corner=site.flow.corner,
        cell_m=site.flow.cell_m / _NODES_A_CELL,
        size=((columns - 1) * _NODES_A_CELL + 1, (rows - 1) * _NODES_A_CELL + 1),
    )
