"""What a pose that begins at a change knows less than one of as many people without a change."""

from dataclasses import replace

import numpy as np

from models.estimation.joint.site import SiteReference
from models.estimation.numbers import TELLING_SD, WITH_HEADING
from models.flow.ends import HEADING_SD
from models.flow.fusion import FusedEstimate
from models.flow.reference import FlowReference
from models.geometry.rotation import Array

# How much surer a part of a window may be of a number than as many people of the reference were:
# another view may be a better one.
_BETTER_VIEW = 2.0


def widened(
    before: FusedEstimate,
    after: FusedEstimate,
    parties: int,
    speeds: SiteReference,
    flow: FlowReference | None,
) -> FusedEstimate:
    """The estimate after a change with the covariance that it deserves.

    The cut is where it suits the tracks best. One party on its wrong side would move the pose by
    the way between the two poses over the number of parties. And no number is surer than so many
    people can make it: few of them, who walk alike, may seem to agree.

    Args:
        before: of the tracks before the change.
        after: of those after it.
        parties: that walk after it.
        speeds: how people walk at the site.
        flow: where they do, if that is known.
    """
    apart = (after.values - before.values) / max(parties, 1)
    floor = least_covariance(parties, speeds, flow)
    covariance = _at_least(after.covariance + np.outer(apart, apart), floor)
    telling = np.sqrt(np.diag(covariance)) <= TELLING_SD
    told = dict(zip(WITH_HEADING, telling, strict=True))
    return replace(
        after, covariance=covariance, told=tuple(name for name in after.told if told[name])
    )


def least_covariance(parties: int, speeds: SiteReference, flow: FlowReference | None) -> Array:
    """The covariance (4, 4) that no number of so many parties is below, by the reference's own."""
    known = np.diag([0.0, 0.0, 0.0, HEADING_SD**-2])
    known[:3, :3] = speeds.information_of_a_track * parties
    if flow is not None:
        known = known + flow.still.information_of_a_party * parties
    floor = 1e-9 * np.trace(known) * np.eye(4)  # what nobody tells is not below anything
    return np.asarray(np.linalg.inv(known + floor)) / _BETTER_VIEW**2


def _at_least(covariance: Array, floor: Array) -> Array:
    """A covariance (4, 4) whose every direction is at least as wide as the floor's."""
    lower = np.linalg.cholesky(floor)
    back = np.linalg.inv(lower)
    sizes, axes = np.linalg.eigh(back @ covariance @ back.T)
    wide = (lower @ axes) * np.sqrt(np.maximum(sizes, 1.0))
    return np.asarray(wide @ wide.T)
