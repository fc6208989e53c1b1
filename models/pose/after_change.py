"""What a pose that begins at a change knows less than one of as many people without a change."""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import identifiable_of
from models.geometry.pose_parameters import PARAMETERS
from models.geometry.rotation import Array
from models.paths.reference import FlowReference
from models.pose.fusion import FusedEstimate
from models.pose.modes import HEADING_SD
from models.walking.speed_reference import SpeedReference

# How much surer a part of a window may be of a parameter than as many people of the reference were:
# another view may be a better one.
_BETTER_VIEW = 2.0


def widened(
    before: FusedEstimate,
    after: FusedEstimate,
    walking_groups: int,
    speed_reference: SpeedReference,
    flow: FlowReference | None,
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
        flow: where they do, if that is known.
    """
    apart = (after.values - before.values) / max(walking_groups, 1)
    floor = least_covariance(walking_groups, speed_reference, flow)
    covariance = _at_least(after.covariance + np.outer(apart, apart), floor)
    known = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return replace(
        after,
        covariance=covariance,
        identifiable=tuple(name for name in after.identifiable if name in known),
    )


def least_covariance(
    walking_groups: int, speed_reference: SpeedReference, flow: FlowReference | None
) -> Array:
    """The covariance (4, 4) that none of so many groups is below, by the reference's own."""
    known = np.diag([0.0, 0.0, 0.0, HEADING_SD**-2])
    known[:3, :3] = speed_reference.information_of_a_track * walking_groups
    if flow is not None:
        known = known + flow.still.information_of_a_group * walking_groups
    floor = 1e-9 * np.trace(known) * np.eye(4)  # what nobody tells is not below anything
    return np.asarray(np.linalg.inv(known + floor)) / _BETTER_VIEW**2


def _at_least(covariance: Array, floor: Array) -> Array:
    """A covariance (4, 4) whose every direction is at least as wide as the floor's."""
    lower = np.linalg.cholesky(floor)
    back = np.linalg.inv(lower)
    sizes, axes = np.linalg.eigh(back @ covariance @ back.T)
    wide = (lower @ axes) * np.sqrt(np.maximum(sizes, 1.0))
    return np.asarray(wide @ wide.T)
