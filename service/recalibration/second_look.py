"""What the tracks of a window say without the newest people: whether a verdict holds."""

import numpy as np

from models.drift.verdict import Drift, DriftLimits, asks_again, drift_between
from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.joint.site import SiteReference
from models.flow.fusion import FusedEstimate, by_speeds_alone, fused_estimate
from models.flow.reference import FlowReference
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.recalibration.references import FEWEST_WALKERS


def drift_of(fused: FusedEstimate, prior: CameraPose) -> Drift:
    """How far an estimate is from the prior pose."""
    return drift_between(fused.parameters, fused.sd, fused.told, prior)


def estimate_of(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    site: SiteReference,
    flow: FlowReference | None,
) -> FusedEstimate:
    """The pose that is to be served of what is seen: by speeds, and by places where known."""
    joint = joint_estimate(observations, prior, site)
    if flow is None:
        return by_speeds_alone(joint, prior)
    return fused_estimate(observations, intrinsics, prior, joint, flow)


def look_again(
    observations: Observations,
    drift: Drift,
    limits: DriftLimits,
    *,
    drifting: bool,
    intrinsics: Intrinsics,
    prior: CameraPose,
    site: SiteReference,
    flow: FlowReference | None,
) -> FusedEstimate | None:
    """The pose without the newest people who walk; None where it is not asked for, or too few are.

    A pose takes a second: only a verdict that is about to change needs it.

    Args:
        observations: of the tracks in the order of their ends.
        drift: by all of them.
        limits: what counts, and how many people are left out.
        drifting: whether a drift is told by now.
        intrinsics: of the camera.
        prior: the prior pose.
        site: how people walk.
        flow: where they do, if that is known.
    """
    if not asks_again(drift, limits, drifting=drifting):
        return None
    walkers = np.unique(observations.steps.rows.owner_idx)
    if walkers.size < limits.people + FEWEST_WALKERS:
        return None
    older = of_tracks(observations, np.arange(walkers[-limits.people]))
    return estimate_of(older, intrinsics, prior, site, flow)
