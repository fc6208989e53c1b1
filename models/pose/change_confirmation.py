"""The second look at a change: are there two poses beyond doubt, and how sure is the later one."""

from dataclasses import replace

import numpy as np

from models.geometry.pose import PARAMETERS, PLANE_PARAMETERS, identifiable_of
from models.geometry.rotation import Array
from models.paths.reference import PathReference
from models.pose import config
from models.pose.pose_fit import FusedEstimate
from models.quantiles import chi_squared_above, f_above
from models.walking.speed_reference import SpeedReference


def moved_beyond_doubt(
    before: FusedEstimate, groups_before: int, after: FusedEstimate, groups_after: int
) -> bool:
    """True if a camera has moved from one estimate to the other.

    Neither chance may have made them so different nor, whoever walked, people's habits. Of few
    groups a covariance is not well known, and chance goes farther. A heading that is not
    identifiable counts for as little as is known of it. There must have been a pose to move from,
    and what has moved the farthest by its standard deviation must be identifiable where it is now:
    the rest may be left open by the few who came since, as the prior's, and is better so than by
    those of before.

    Source: Hotelling 1931, T squared, by the freedom of the smaller part; with habits, whose
    variance is given, a chi square.
    """
    groups = min(groups_before, groups_after)
    posed = set(PLANE_PARAMETERS) <= set(before.identifiable)
    if groups < config.GROUPS_OF_A_COVARIANCE or not posed:
        return False
    offset = after.values - before.values
    chance = before.covariance + after.covariance
    habits = chance + 2 * np.diag(config.HABITS)
    farthest = PARAMETERS[int(np.argmax(offset**2 / np.diag(habits)))]
    if farthest not in set(before.identifiable) & set(after.identifiable):
        return False
    parameters, freedom = len(PARAMETERS), groups - len(PARAMETERS)
    highest = f_above(config.MOVED_BY_CHANCE, parameters, freedom)
    limit = parameters * (groups - 1) / freedom * highest
    beyond_chance = float(offset @ np.linalg.solve(chance, offset)) > limit
    beyond_habit = float(offset @ np.linalg.solve(habits, offset)) > chi_squared_above(
        config.MOVED_BY_HABIT, parameters
    )
    return beyond_chance and beyond_habit


def widened(
    before: FusedEstimate,
    after: FusedEstimate,
    walking_groups: int,
    speed_reference: SpeedReference,
    paths: PathReference | None,
) -> FusedEstimate:
    """The estimate after a change with the covariance that it deserves.

    The cut is where it suits the tracks best. One group on its wrong side would move the pose by
    the way between the two poses over the number of groups. And no parameter is surer than so many
    people can make it: few of them, who walk alike, may seem to agree.

    Args:
        before: of the tracks before the change.
        after: of those after it.
        walking_groups: that walk after it.
        speed_reference: how people walk at the site.
        paths: where they do, if that is known.
    """
    offset = (after.values - before.values) / max(walking_groups, 1)
    floor = least_covariance(walking_groups, speed_reference, paths)
    covariance = _at_least(after.covariance + np.outer(offset, offset), floor)
    determined = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return replace(
        after,
        covariance=covariance,
        identifiable=tuple(name for name in after.identifiable if name in determined),
    )


def least_covariance(
    walking_groups: int, speed_reference: SpeedReference, paths: PathReference | None
) -> Array:
    """The covariance (4, 4) that none of so many groups is below, by the reference's own."""
    information = np.diag([0.0, 0.0, 0.0, config.HEADING_SD**-2])
    information[:3, :3] = speed_reference.information_of_a_track * walking_groups
    if paths is not None:
        information = information + paths.still.information_of_a_group * walking_groups
    floor = 1e-9 * np.trace(information) * np.eye(4)  # what nobody shows is not below anything
    return np.asarray(np.linalg.inv(information + floor)) / config.BETTER_VIEW**2


def _at_least(covariance: Array, floor: Array) -> Array:
    """A covariance (4, 4) whose every direction is at least as wide as the floor's."""
    lower = np.linalg.cholesky(floor)
    back = np.linalg.inv(lower)
    sizes, axes = np.linalg.eigh(back @ covariance @ back.T)
    wide = (lower @ axes) * np.sqrt(np.maximum(sizes, 1.0))
    return np.asarray(wide @ wide.T)
