"""Whether a camera has moved among the tracks of a window, by how people walk and where."""

from collections.abc import Sequence

import numpy as np

from models.drift.change_point import find_change
from models.drift.confirmation import moved_beyond_doubt
from models.estimation.joint.estimate import JointEstimate, joint_estimate
from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.joint.site import SiteReference
from models.flow.evidence import walkers_of
from models.flow.move import moved_within
from models.flow.reference import FlowReference, candidate_of
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.recalibration.references import FEWEST_WALKERS

_CUT_RATE = 1e-6  # of windows of a still camera are cut where nothing happened


def change_among(
    observations: Observations,
    ends_s: Array,
    intrinsics: Intrinsics,
    prior: CameraPose,
    site: SiteReference,
    flow: FlowReference | None,
) -> tuple[int | None, Observations, JointEstimate]:
    """The first track after a change that is beyond doubt, what is seen from there on, its pose.

    Args:
        observations: of the window's tracks, in the order of their ends.
        ends_s: these (tracks,).
        intrinsics: of the camera.
        prior: the prior pose.
        site: how people walk.
        flow: where they do, if that is known.
    """
    found = find_change(observations, prior, site)
    if found is not None:
        parts = _parted(observations, ends_s, found.track_idx)
        if parts is not None:
            before, after = (joint_estimate(part, prior, site) for part in parts)
            if moved_beyond_doubt(before, after):
                return found.track_idx, parts[1], after
    if flow is not None:
        at = candidate_of(prior)
        walkers = walkers_of(observations, at)
        turned = moved_within(walkers, flow.site(intrinsics), at, flow.still, _CUT_RATE)
        parts = None if turned is None else _parted(observations, ends_s, turned)
        if parts is not None:
            return turned, parts[1], joint_estimate(parts[1], prior, site)
    return None, observations, joint_estimate(observations, prior, site)


def _parted(
    observations: Observations, ends_s: Array, track_idx: int
) -> Sequence[Observations] | None:
    """What is seen before and after a track; None where too few walk in either."""
    old, new = (
        np.flatnonzero(part) for part in (ends_s < ends_s[track_idx], ends_s >= ends_s[track_idx])
    )
    parts = of_tracks(observations, old), of_tracks(observations, new)
    return None if min(part.walkers for part in parts) < FEWEST_WALKERS else parts
