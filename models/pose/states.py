"""The state of a camera by a window: one derivation, of the posterior over what moved."""

from enum import StrEnum

import numpy as np

from models.geometry.pose import ANGLES, PARAMETERS
from models.monitoring.verdict import LIKELY
from models.pose import config
from models.pose.hypotheses import PosePosterior
from models.pose.pose_fit import FusedEstimate


class WindowState(StrEnum):
    """State by a window. Where too little is known to say that a camera stands: `learning`.

    `site_changed` is with pictures alone: they say that it stands, and people walk elsewhere.
    """

    LEARNING = "learning"
    OK = "ok"
    SUSPECTED = "suspected"
    UNSURE = "unsure"
    DRIFTING = "drifting"
    SITE_CHANGED = "site_changed"


def state_of(
    posterior: PosePosterior, fused: FusedEstimate, *, drifting: bool, mapped: bool
) -> WindowState:
    """The state by a window.

    `drifting` is the verdict. Unless paths are `mapped`, nobody can tell a turn in heading.
    """
    if drifting:
        return WindowState.DRIFTING
    if posterior.pictured and posterior.moved < LIKELY:
        changed = is_site_changed(posterior, fused)
        return WindowState.SITE_CHANGED if changed else WindowState.OK
    if fused.paths_changed and not posterior.pictured:
        return WindowState.UNSURE
    if posterior.moved >= LIKELY:
        return WindowState.SUSPECTED
    return WindowState.OK if is_noticed(posterior, fused, mapped=mapped) else WindowState.LEARNING


def is_site_changed(posterior: PosePosterior, fused: FusedEstimate) -> bool:
    """True where a picture says that the camera stands, and people walk elsewhere all the same."""
    stands = posterior.pictured and posterior.moved < LIKELY
    return stands and (fused.paths_changed or posterior.site_changed >= LIKELY)


def is_noticed(posterior: PosePosterior, fused: FusedEstimate, *, mapped: bool) -> bool:
    """True where a turn of 12 deg would have been noticed, and none of 5 deg may have been made.

    Of a site that is `mapped`, in heading too; without a map nobody can tell that.
    """
    angles = [name for name in ANGLES if mapped or name != "heading"]
    sds = np.sqrt(np.diag(fused.covariance))
    if not fused.identifiable or (mapped and not fused.registered) or fused.paths_changed:
        return False
    noticed = all(sds[PARAMETERS.index(name)] < config.NOTICED_SD for name in angles)
    ends = [abs(end) for name in angles for end in posterior.interval(name, 0.9)]
    return noticed and max(ends) < config.NOTICED_RAD
