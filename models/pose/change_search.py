"""Whether a camera has moved among the tracks of a window, by how people walk and where."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from models.paths.likelihood import walkers_of
from models.paths.turn_detection import moved_within
from models.pose.after_change import widened
from models.pose.change_point import find_change, suspicion
from models.pose.confirmation import moved_beyond_doubt
from models.pose.fusion import FusedEstimate, by_speeds_alone, fused_estimate
from models.pose.site import CameraSite
from models.pose.warm_start import (
    FullSearch,
    LastPose,
    Posed,
    begins_at,
    fit_of,
    is_as_before,
    is_calm,
    last_pose,
)
from models.tracks.observations import Observations, of_tracks
from models.walking.config import FEWEST_WALKERS
from models.walking.estimate import joint_estimate
from models.walking.fit import Near

_SUSPECTED = 1.0  # of the limit, by scores: it is twice that wherever a cut is confirmed
_SUSPECT_RATE = 0.01  # of windows of a camera that stands are looked at twice


@dataclass(frozen=True, slots=True, kw_only=True)
class Searched:
    """What a window comes to: the tracks from the newest change on, and their pose.

    `change_idx` is the first track after the change; None where there was none. `first` is the
    first that ended with it or later: `tracks` are from there on. `last` is what a next search may
    begin at; None where this one suspects something.
    """

    change_idx: int | None
    first: int
    tracks: Observations
    posed: Posed
    last: LastPose | None = None


def posed(tracks: Observations, site: CameraSite, near: LastPose | None = None) -> Posed:
    """The pose of tracks that are of one: by speeds, and by places where these are known.

    Where it is known to be `near` that of almost the same tracks, others are not looked at.
    """
    ends, means = ((), ()) if near is None else (tuple(near.joint.ends), near.means)
    joint = joint_estimate(tracks, site.prior, site.speed_reference, ends, means)
    if site.flow is None:
        fused = by_speeds_alone(joint, site.prior)
    else:
        fused = fused_estimate(
            tracks,
            site.intrinsics,
            site.prior,
            joint,
            site.speed_reference,
            site.flow,
            () if near is None else tuple(near.fused.ends),
            None if near is None else near.around,
        )
    return Posed(joint=joint, fused=fused)


def search_change(tracks: Observations, site: CameraSite, last: LastPose | None = None) -> Searched:
    """The newest change of the camera that is beyond doubt, and the pose from there on.

    Where people walk another way than before, or elsewhere, a window is suspected; it is cut
    where the parts before and after, each asked alone, are of two poses beyond doubt.

    Args:
        tracks: of the window, in the order of their ends.
        site: how people walk, and where, if that is known.
        last: the pose of almost the same tracks: where nothing speaks against it, no others are
            looked at, and no change is looked for.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    if last is not None and begins_at(last, tracks):
        found = _still_there(tracks, site, last)
        if found is not None:
            return found
    whole = posed(tracks, site)
    suspected = False
    for change_idx in _suspected(tracks, site, whole.fused):
        suspected = True
        first, parts = _parted(tracks, change_idx)
        if parts is None:
            continue
        before, after = (posed(part, site) for part in parts)
        if moved_beyond_doubt(
            before.fused, before.joint.walking_groups, after.fused, after.joint.walking_groups
        ):
            fused = widened(
                before.fused,
                after.fused,
                after.joint.walking_groups,
                site.speed_reference,
                site.flow,
            )
            return Searched(
                change_idx=change_idx,
                first=first,
                tracks=parts[1],
                posed=replace(after, fused=fused),
            )
    begin = None
    if not suspected and tracks.tracks:
        search = FullSearch(
            ended_s=tracks.ended_s,
            suspicion=_suspicion(tracks, site, whole),
            fit=fit_of(whole),
        )
        begin = last_pose(whole, site.prior, search)
    return Searched(change_idx=None, first=0, tracks=tracks, posed=whole, last=begin)


def _still_there(tracks: Observations, site: CameraSite, last: LastPose) -> Searched | None:
    """What tracks come to at the last pose; None where anything speaks against it."""
    found = posed(tracks, site, last)
    if not is_as_before(found, last) or _turned(tracks, site, found.fused) is not None:
        return None
    search, suspected = last.search, _suspicion(tracks, site, found)
    if not is_calm(suspected, last):
        around = found.fused.around
        near = None if around is None or suspected > _SUSPECTED else around.told
        if _hurried(tracks, site, found.fused, near) is not None:
            return None
        search = replace(search, suspicion=suspected)
    begin = last_pose(found, site.prior, search)
    return Searched(change_idx=None, first=0, tracks=tracks, posed=found, last=begin)


def _suspicion(tracks: Observations, site: CameraSite, whole: Posed) -> float:
    """How much better two poses explain the speeds than one, where the camera looks by now."""
    turned = replace(site.prior, heading_rad=whole.fused.parameters.heading_rad)
    return suspicion(tracks, turned, site.speed_reference, whole.joint.raw)


def _suspected(tracks: Observations, site: CameraSite, whole: FusedEstimate) -> Iterator[int]:
    """Where the camera may have moved, by speeds and by places: the first tracks after it.

    Both are asked where the camera stands by all tracks together. Asked at the prior pose, a
    camera that moved long ago seems to move with every change of the crowd.
    """
    for look in (_hurried, _turned):
        moved = look(tracks, site, whole)
        if moved is not None:
            yield moved


def _hurried(
    tracks: Observations, site: CameraSite, whole: FusedEstimate, near: Near | None = None
) -> int | None:
    """Where the camera may have moved by speeds; None where it did not."""
    turned = replace(site.prior, heading_rad=whole.parameters.heading_rad)
    found = find_change(tracks, turned, site.speed_reference, near)
    return None if found is None else found.track_idx


def _turned(tracks: Observations, site: CameraSite, whole: FusedEstimate) -> int | None:
    """Where the camera may have moved by places; None where it did not, or they are unknown."""
    if site.flow is None:
        return None
    at = whole.values
    paths = site.flow.site(site.intrinsics)
    return moved_within(walkers_of(tracks, at), paths, at, site.flow.still, _SUSPECT_RATE)


def _parted(
    tracks: Observations, change_idx: int
) -> tuple[int, tuple[Observations, Observations] | None]:
    """Where the part after a change begins, and what is seen before and after it.

    None where too few walk in either. Tracks that ended at the same time are in the same part.
    """
    first = int(np.searchsorted(tracks.ended_s, tracks.ended_s[change_idx], side="left"))
    before = of_tracks(tracks, np.arange(first))
    after = of_tracks(tracks, np.arange(first, tracks.tracks))
    enough = min(before.walkers, after.walkers) >= FEWEST_WALKERS
    return first, (before, after) if enough else None
