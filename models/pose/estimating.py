"""The pose of a camera whose site is known, by its tracks: by speeds, places and since when.

Since when: whether a camera moved within a window is searched for by how people walk and where.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from models.geometry.pose import CameraPose, array_of
from models.geometry.rotation import Array
from models.monitoring.drift import LIKELY, Drift, pose_after
from models.paths.likelihood import walkers_of
from models.paths.path_tests import moved_within
from models.pose import config
from models.pose.causes import Cause, CauseGains, cause_gains, likeliest_causes
from models.pose.change_point import find_change, moved_beyond_doubt, suspicion, widened
from models.pose.factors import Factor
from models.pose.fusion import fused_estimate
from models.pose.hypotheses import PosePosterior, drift_of, pose_posterior
from models.pose.move_time import MovedBetween, moved_between
from models.pose.pose_fit import (
    FullSearch,
    FusedEstimate,
    PoseFit,
    WarmStart,
    by_speeds_alone,
    warm_start_of,
)
from models.pose.site import CameraSite
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.config import FEWEST_WALKERS
from models.walking.estimate import JointEstimate, joint_estimate
from models.walking.fit import FitStart


@dataclass(frozen=True, slots=True, kw_only=True)
class PartialFailure:
    """A part that is not needed and could not be made, and the error that it failed with."""

    part: str
    error: Exception


@dataclass(frozen=True, kw_only=True)
class PoseFinding:
    """The pose of a window, from the newest change on.

    `joint` is by speeds alone and `fused` by places too. `change_idx` is the first track after the
    change, None where there was none, and `first` the first that counts. `failures` are of what is
    beside. `warm_start` is where the next estimate may begin; None where it has to search all
    poses. `moved_prior` is how likely it was, before any track, that the camera has moved.
    `factors` are evidence beside the tracks. `gains` are what other causes than a move explain;
    None where nothing looks like one. `between` is when the camera moved, among the tracks of the
    whole window; None if that is not known.
    """

    prior: CameraPose
    joint: JointEstimate
    fused: FusedEstimate
    change_idx: int | None = None
    first: int = 0
    failures: tuple[PartialFailure, ...] = ()
    warm_start: WarmStart | None = None
    moved_prior: float = config.MOVED_PRIOR
    factors: tuple[Factor, ...] = ()
    gains: CauseGains | None = None
    between: MovedBetween | None = None

    @cached_property
    def posterior(self) -> PosePosterior:
        """The posterior over what moved."""
        groups, moved_prior = self.joint.walking_groups, self.moved_prior
        posterior = pose_posterior(self.fused, groups, self.prior, moved_prior)
        for factor in self.factors:
            posterior = factor.updated(posterior, moved_prior)
        return posterior

    @cached_property
    def causes(self) -> tuple[Cause, Cause] | None:
        """How likely the clock is wrong, and how likely the lens is another; None of neither.

        A picture knows better than people whether the camera stands, by the same lens.
        """
        if self.gains is None or self.posterior.pictured:
            return None
        groups = self.joint.walking_groups
        return likeliest_causes(self.gains, self.posterior, groups, self.moved_prior)

    @cached_property
    def drift(self) -> Drift:
        """The drift from the prior pose, with standard deviations."""
        return drift_of(self.posterior, self.fused)

    @property
    def pose(self) -> CameraPose:
        """The prior pose moved by what is identifiable."""
        return pose_after(self.drift, self.prior)


def estimate_pose(
    tracks: Observations,
    site: CameraSite,
    warm_start: WarmStart | None = None,
    *,
    alerted: bool = False,
) -> PoseFinding:
    """The pose that explains tracks best, from the newest change of the camera on.

    The search by paths may fail: the pose is by speeds alone then, and the failure is named. Of
    a site that was not learned, all tracks count and the walking speed is assumed.

    `warm_start` is of the finding of almost the same tracks at the same site: where nothing speaks
    against it, its pose is refined, which takes a quarter to a half of the time and comes to the
    same. Other causes than a move are asked for where all poses were searched, where a move is not
    unlikely, and where an alert reports a change (`alerted`).

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(tracks)
    prior = site.prior
    if not site.learned:
        joint = joint_estimate(tracks, prior, site.speed_reference)
        fused = by_speeds_alone(joint, prior)
        return PoseFinding(prior=prior, joint=joint, fused=fused)
    failures: list[PartialFailure] = []
    found = None
    if site.paths is not None:
        search = partial(search_change, tracks, site, _at_site(warm_start, site))
        found = unless_failed(failures, "flow_map", search)
    if found is None:
        site = replace(site, paths=None)
        found = search_change(tracks, site, None if failures else _at_site(warm_start, site))
    finding = PoseFinding(
        prior=prior,
        joint=found.fit.joint,
        fused=found.fit.fused,
        change_idx=found.change_idx,
        first=found.first,
        failures=tuple(failures),
        warm_start=None if failures else found.warm_start,
        between=found.between,
    )
    refined = warm_start is not None and found.searched_before(warm_start)
    if refined and not alerted and finding.posterior.moved < config.CAUSE_MOVED:
        return finding
    ask = partial(cause_gains, found.tracks, site, finding.joint, finding.fused)
    gains = unless_failed(failures, "causes", ask)
    return replace(finding, gains=gains, failures=tuple(failures))


def with_time_of_move(found: PoseFinding, tracks: Observations, site: CameraSite) -> PoseFinding:
    """The finding of a window with when the camera moved, if it moved likelier than not.

    The move is from the prior pose, unless a change within the window was found.
    """
    if found.between is not None or found.posterior.moved < LIKELY or not site.learned:
        return found

    def fit(later: Observations) -> Array:
        return pose_fit_of(later, site).fused.values

    at = array_of(site.prior), found.fused.values
    return replace(found, between=moved_between(tracks, site, *at, fit))


def _at_site(warm_start: WarmStart | None, site: CameraSite) -> WarmStart | None:
    """The warm start, where it is of the same site; else None."""
    if warm_start is None or warm_start.prior != site.prior:
        return None
    return warm_start if warm_start.registered == (site.paths is not None) else None


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


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSearch:
    """The tracks of a window from its newest change on, and their pose.

    `change_idx` is the first track after the change; None where there was none. `first` is the
    first that ended with it or later: `tracks` are from there on. `warm_start` is where a next
    search may begin; None where this one suspects something. `between` is when the change was.
    """

    change_idx: int | None
    first: int
    tracks: Observations
    fit: PoseFit
    warm_start: WarmStart | None = None
    between: MovedBetween | None = None

    def searched_before(self, begun: WarmStart) -> bool:
        """True if all that was done is to refine the pose that it began at."""
        return self.warm_start is not None and (
            self.warm_start.search.ended_s is begun.search.ended_s
        )


def pose_fit_of(
    tracks: Observations, site: CameraSite, warm_start: WarmStart | None = None
) -> PoseFit:
    """The pose of tracks that are of one: by speeds, and by places where these are known."""
    starts = () if warm_start is None else warm_start.speed_starts
    joint = joint_estimate(tracks, site.prior, site.speed_reference, starts)
    return PoseFit(joint=joint, fused=fused_estimate(tracks, site, joint, warm_start))


def search_change(
    tracks: Observations, site: CameraSite, warm_start: WarmStart | None = None
) -> ChangeSearch:
    """The newest change of the camera that is beyond doubt, and the pose from there on.

    Where people walk another way than before, or elsewhere, a window is suspected; it is cut
    where the parts before and after, each estimated alone, are of two poses beyond doubt.

    Where nothing speaks against `warm_start`, the pose of almost the same tracks, no others are
    searched, and no change is.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    if warm_start is not None and warm_start.suits(tracks):
        found = _still_there(tracks, site, warm_start)
        if found is not None:
            return found
    whole = pose_fit_of(tracks, site)
    suspected = False
    for change_idx in _suspects(tracks, site, whole.fused):
        suspected = True
        found = _confirmed(tracks, site, change_idx)
        if found is not None:
            return found
    begin = None
    if not suspected and tracks.tracks:
        search = FullSearch(
            ended_s=tracks.ended_s,
            suspicion=_suspicion(tracks, site, whole),
            path_fit=whole.mean_path_fit,
        )
        begin = warm_start_of(whole, site.prior, search)
    return ChangeSearch(change_idx=None, first=0, tracks=tracks, fit=whole, warm_start=begin)


def _confirmed(tracks: Observations, site: CameraSite, change_idx: int) -> ChangeSearch | None:
    """The pose after a change; None where it is not beyond doubt, or too few walk on either side.

    Tracks that ended at the same time are on the same side.
    """
    first = int(np.searchsorted(tracks.ended_s, tracks.ended_s[change_idx], side="left"))
    earlier = of_tracks(tracks, np.arange(first))
    later = of_tracks(tracks, np.arange(first, tracks.tracks))
    if min(earlier.walkers, later.walkers) < FEWEST_WALKERS:
        return None
    before, after = pose_fit_of(earlier, site), pose_fit_of(later, site)
    groups = after.joint.walking_groups
    if not moved_beyond_doubt(before.fused, before.joint.walking_groups, after.fused, groups):
        return None
    fused = widened(before.fused, after.fused, groups, site.speed_reference, site.paths)
    return ChangeSearch(
        change_idx=change_idx,
        first=first,
        tracks=later,
        fit=replace(after, fused=fused),
        between=moved_between(tracks, site, before.fused.values, after.fused.values),
    )


def _still_there(
    tracks: Observations, site: CameraSite, warm_start: WarmStart
) -> ChangeSearch | None:
    """The pose that is refined from a warm start; None where anything speaks against it."""
    found = pose_fit_of(tracks, site, warm_start)
    if not warm_start.is_refined_by(found):
        return None
    if _moved_by_places(tracks, site, found.fused) is not None:
        return None
    search, suspected = warm_start.search, _suspicion(tracks, site, found)
    if not warm_start.is_calm(suspected):
        speeds = None if suspected > config.SUSPECTED else found.fused.speeds
        if _moved_by_speeds(tracks, site, found.fused, speeds) is not None:
            return None
        search = replace(search, suspicion=suspected)
    begin = warm_start_of(found, site.prior, search)
    return ChangeSearch(change_idx=None, first=0, tracks=tracks, fit=found, warm_start=begin)


def _suspicion(tracks: Observations, site: CameraSite, whole: PoseFit) -> float:
    """The gain of two poses over one in explaining the speeds, where the camera looks by now."""
    turned = replace(site.prior, heading_rad=whole.fused.parameters.heading_rad)
    return suspicion(tracks, turned, site.speed_reference, whole.joint.raw)


def _suspects(tracks: Observations, site: CameraSite, whole: FusedEstimate) -> Iterator[int]:
    """The first tracks after a possible move of the camera, by speeds and by places.

    Both look from where the camera stands by all tracks together. From the prior pose, a
    camera that moved long ago seems to move with every change of the crowd.
    """
    for look in (_moved_by_speeds, _moved_by_places):
        moved = look(tracks, site, whole)
        if moved is not None:
            yield moved


def _moved_by_speeds(
    tracks: Observations,
    site: CameraSite,
    whole: FusedEstimate,
    warm_start: FitStart | None = None,
) -> int | None:
    """The first track after a possible move by speeds; None where there is none."""
    turned = replace(site.prior, heading_rad=whole.parameters.heading_rad)
    found = find_change(tracks, turned, site.speed_reference, warm_start)
    return None if found is None else found.track_idx


def _moved_by_places(tracks: Observations, site: CameraSite, whole: FusedEstimate) -> int | None:
    """The first track after a possible move by places; None where there is none, or no paths."""
    if site.paths is None:
        return None
    at = whole.values
    paths = site.paths.model(site.intrinsics)
    return moved_within(walkers_of(tracks, at), paths, at, site.paths.still, config.SUSPECT_RATE)
