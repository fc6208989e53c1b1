"""The pose of a camera whose site is known, by its tracks: by speeds, places and since when."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from models.geometry.pose import CameraPose
from models.monitoring.verdict import Drift, DriftLimits, asks_again, drift_between, pose_after
from models.pose.change_search import pose_fit_of, search_change
from models.pose.pose_fit import FusedEstimate, WarmStart, by_speeds_alone
from models.pose.site import CameraSite
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.config import FEWEST_WALKERS
from models.walking.estimate import JointEstimate, joint_estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class PartialFailure:
    """A part that is not needed and could not be made, and the error that it failed with."""

    part: str
    error: Exception


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondLook:
    """The limits of a verdict, and whether the camera is taken for moved by now."""

    limits: DriftLimits
    drifting: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseFinding:
    """The pose of a window, from the newest change on.

    `joint` is by speeds alone and `fused` by places too: the one to be served. `earlier` is the
    same without the newest people; None unless a verdict asks for it. `change_idx` is the first
    track after the change, None where there was none, and `first` the first that counts.
    `failures` are of what is beside. `warm_start` is where the next estimate may begin; None where
    it has to search all poses.
    """

    prior: CameraPose
    joint: JointEstimate
    fused: FusedEstimate
    earlier: FusedEstimate | None = None
    change_idx: int | None = None
    first: int = 0
    failures: tuple[PartialFailure, ...] = ()
    warm_start: WarmStart | None = None

    @property
    def drift(self) -> Drift:
        """The drift from the prior pose, with standard deviations."""
        return drift_of(self.fused, self.prior)

    @property
    def pose(self) -> CameraPose:
        """The prior pose moved by what is identifiable."""
        return pose_after(self.drift, self.prior)


def estimate_pose(
    tracks: Observations,
    site: CameraSite,
    second_look: SecondLook | None = None,
    warm_start: WarmStart | None = None,
) -> PoseFinding:
    """The pose that explains tracks best, from the newest change of the camera on.

    The search by paths may fail: the pose is by speeds alone then, and the failure is named. Of
    a site that was not learned, all tracks count and the walking speed is assumed.

    Args:
        tracks: of the window, in the order of their ends.
        site: of the camera.
        second_look: what a verdict goes by, if there is to be one: where it is about to change, the
            pose is estimated without the newest people, too. That takes as long again.
        warm_start: of the finding of almost the same tracks at the same site, the newest of them
            left out and some older ones: where nothing speaks against it, its pose is refined,
            which takes a quarter to a half of the time and comes to the same.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(tracks)
    prior = site.prior
    if not site.learned:
        joint = joint_estimate(tracks, prior, site.speed_reference)
        return PoseFinding(prior=prior, joint=joint, fused=by_speeds_alone(joint, prior))
    failures: list[PartialFailure] = []
    found = None
    if site.paths is not None:
        search = partial(search_change, tracks, site, _at_site(warm_start, site))
        found = unless_failed(failures, "flow_map", search)
    if found is None:
        site = replace(site, paths=None)
        found = search_change(tracks, site, None if failures else _at_site(warm_start, site))
    fused = found.fit.fused
    earlier = None
    if second_look is not None:
        earlier = _look_again(found.tracks, drift_of(fused, prior), second_look, site)
    return PoseFinding(
        prior=prior,
        joint=found.fit.joint,
        fused=fused,
        earlier=earlier,
        change_idx=found.change_idx,
        first=found.first,
        failures=tuple(failures),
        warm_start=None if failures else found.warm_start,
    )


def _at_site(warm_start: WarmStart | None, site: CameraSite) -> WarmStart | None:
    """The warm start, where it is of the same site; else None."""
    if warm_start is None or warm_start.prior != site.prior:
        return None
    return warm_start if warm_start.registered == (site.paths is not None) else None


def drift_of(fused: FusedEstimate, prior: CameraPose) -> Drift:
    """The drift of an estimate from the prior pose."""
    return drift_between(fused.parameters, fused.sd, fused.identifiable, prior)


def _look_again(
    tracks: Observations, drift: Drift, second_look: SecondLook, site: CameraSite
) -> FusedEstimate | None:
    """The pose without the newest people who walk; None where it is not needed, or too few do.

    A pose takes a second: only a verdict that is about to change needs it.
    """
    limits = second_look.limits
    if not asks_again(drift, limits, drifting=second_look.drifting):
        return None
    walkers = np.unique(tracks.steps.rows.owner_idx)
    if walkers.size < limits.people + FEWEST_WALKERS:
        return None
    older = of_tracks(tracks, np.arange(walkers[-limits.people]))
    return pose_fit_of(older, site).fused


_Made = TypeVar("_Made")


def unless_failed(
    failures: list[PartialFailure], part: str, make: Callable[[], _Made]
) -> _Made | None:
    """The part that is made; None if it failed, and then there is one failure more."""
    try:
        return make()
    except Exception as error:
        failures.append(PartialFailure(part=part, error=error))
        return None
