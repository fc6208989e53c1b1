"""Whether a camera has moved among the tracks of a window, by how people walk and where."""

from dataclasses import dataclass

import numpy as np

from models.drift.change_point import find_change
from models.drift.confirmation import moved_beyond_doubt
from models.estimation.joint.estimate import JointEstimate, joint_estimate
from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.joint.reference import FEWEST_WALKERS
from models.flow.likelihood import walkers_of
from models.flow.reference import candidate_of
from models.flow.turn_detection import moved_within
from models.recalibration.site import CameraSite

_CUT_RATE = 1e-6  # of windows of a still camera are cut where nothing happened


@dataclass(frozen=True, slots=True, kw_only=True)
class Searched:
    """What a window comes to: the tracks from the newest change on, and their pose by speeds.

    `change_idx` is the first track after the change; None where there was none. `first` is the
    first that ended with it or later: `tracks` are from there on.
    """

    change_idx: int | None
    first: int
    tracks: Observations
    joint: JointEstimate


def search_change(tracks: Observations, site: CameraSite) -> Searched:
    """The newest change of the camera that is beyond doubt, and the pose from there on.

    Args:
        tracks: of the window, in the order of their ends.
        site: how people walk, and where, if that is known.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    prior, speed_reference = site.prior, site.speed_reference
    found = find_change(tracks, prior, speed_reference)
    if found is not None:
        first, parts = _parted(tracks, found.track_idx)
        if parts is not None:
            before, after = (joint_estimate(part, prior, speed_reference) for part in parts)
            if moved_beyond_doubt(before, after):
                return Searched(
                    change_idx=found.track_idx, first=first, tracks=parts[1], joint=after
                )
    if site.flow is not None:
        at = candidate_of(prior)
        paths = site.flow.site(site.intrinsics)
        turned = moved_within(walkers_of(tracks, at), paths, at, site.flow.still, _CUT_RATE)
        first, parts = (0, None) if turned is None else _parted(tracks, turned)
        if parts is not None:
            joint = joint_estimate(parts[1], prior, speed_reference)
            return Searched(change_idx=turned, first=first, tracks=parts[1], joint=joint)
    joint = joint_estimate(tracks, prior, speed_reference)
    return Searched(change_idx=None, first=0, tracks=tracks, joint=joint)


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
