"""Whether an estimate may begin where the last one ended, or has to look at all poses again.

Of almost the same tracks the likelihood has almost the same peaks, and Gauss-Newton ends at them
wherever near them it begins. What may have changed with a few new tracks is which peak is the
highest, and whether one pose explains all tracks: any sign of that, and a share of the window that
is new since all poses were looked at, sends an estimate to the full search.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.plane_parameters import PLANE_PARAMETERS
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS
from models.geometry.rotation import Array
from models.pose.fusion import Around, FusedEstimate
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate

_FEWEST = 150  # tracks: of fewer a full search is soon made, and each of them counts for much
_NEW = 0.5  # of the window: with a quarter, estimates are as near to those of all poses
_FARTHEST = 1.0  # standard deviations that a few new tracks move a pose by
_WIDER = 1.25  # times the standard deviation
_WORSE = 10.0  # of the log likelihood: other ends are of some 40 less, or known
_SUSPICION, _MORE_SUSPICION = 0.4, 1.25  # of the limit; times what it was where nothing was found


@dataclass(frozen=True, slots=True, kw_only=True)
class Posed:
    """The pose of some tracks: `joint` by speeds alone, `fused` by places too."""

    joint: JointEstimate
    fused: FusedEstimate


@dataclass(frozen=True, slots=True, kw_only=True)
class FullSearch:
    """When all poses and all moments of a change were last looked at, and no change was found.

    `ended_s` (tracks,) is when each of its tracks ended, in order. `suspicion` is how much two
    poses explained speeds better than one when a change was last looked for, in units of the
    limit; `fit` how well a walking group fitted the map. None is made of a window that was
    suspected.
    """

    ended_s: Array
    suspicion: float
    fit: float

    @property
    def to_s(self) -> float:
        """When the newest of its tracks ended."""
        return float(self.ended_s[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """What of an estimate the next one goes by: few enough numbers to be stored with each.

    `values` and `covariance` are the estimate's; `ends` (ends, parameters) is where its search
    ended, the best first.
    """

    values: Array
    covariance: Array
    ends: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LastPose:
    """Where the next estimate may begin: the pose of almost the same tracks at the same site.

    `joint` is by speeds alone, which determine all that they may; `means` are the coefficients of
    their fields. `fused` is by places too, where they are `registered`: what they determine
    together is `identifiable`, and `said` is the code of what was to be said of the map. `around`
    is what else was found at its end, where there was a single one. `search` is when all other
    poses were looked at.
    """

    prior: CameraPose
    joint: Settled
    means: tuple[Array, ...]
    fused: Settled
    registered: bool
    identifiable: tuple[str, ...]
    said: str | None
    search: FullSearch
    around: Around | None = None


def last_pose(found: Posed, prior: CameraPose, search: FullSearch) -> LastPose | None:
    """What a next estimate may begin at; None where that would have to look at all poses anyway."""
    joint, fused = found.joint, found.fused
    if joint.reason is not None or joint.identifiable != PLANE_PARAMETERS:
        return None
    if fused.identifiable[: len(PLANE_PARAMETERS)] != PLANE_PARAMETERS:
        return None
    return LastPose(
        prior=prior,
        joint=_settled(joint),
        means=joint.means,
        fused=_settled(fused),
        registered=fused.registered,
        identifiable=fused.identifiable,
        said=_code(fused),
        search=search,
        around=fused.around if len(fused.ends) == 1 else None,
    )


def begins_at(last: LastPose, tracks: Observations) -> bool:
    """Whether tracks are so much the same that their pose is looked for at the last one alone."""
    # Late tracks are as new: a tracker may post yesterday's today.
    new = int((~np.isin(tracks.ended_s, last.search.ended_s)).sum())
    return (
        tracks.tracks >= max(_FEWEST, (1 - _NEW) * last.search.ended_s.size)
        and new <= _NEW * tracks.tracks
    )


def is_as_before(found: Posed, last: LastPose) -> bool:
    """Whether a pose that was looked for at the last one alone is another version of it."""
    joint, fused = found.joint, found.fused
    return (
        joint.identifiable == PLANE_PARAMETERS
        and fused.identifiable == last.identifiable
        and fused.registered == last.registered
        and _code(fused) == last.said
        and len(fused.ends) == len(last.fused.ends)
        and fit_of(found) > last.search.fit - _WORSE / max(joint.walking_groups, 1)
        and _is_near(joint, last.joint, PLANE_PARAMETERS)
        and _is_near(fused, last.fused, last.identifiable)
    )


def is_calm(suspicion: float, last: LastPose) -> bool:
    """Whether tracks are no more suspected of a change than those were that had none."""
    return suspicion <= max(_SUSPICION, _MORE_SUSPICION * last.search.suspicion)


def fit_of(posed: Posed) -> float:
    """How well a walking group fits the map, in the mean."""
    return posed.fused.fit / max(posed.joint.walking_groups, 1)


def _code(fused: FusedEstimate) -> str | None:
    return None if fused.reason is None else str(fused.reason.code)


def _settled(found: JointEstimate | FusedEstimate) -> Settled:
    ends = np.array(found.ends, dtype=np.float64).reshape(-1, found.values.size)
    return Settled(values=found.values, covariance=found.covariance, ends=ends)


def _is_near(found: JointEstimate | FusedEstimate, last: Settled, asked: tuple[str, ...]) -> bool:
    """Whether the parameters asked for are as before, and as sure."""
    places = [PARAMETERS.index(name) for name in asked]
    sd, last_sd = (np.sqrt(np.diag(each.covariance)[places]) for each in (found, last))
    near = np.abs(found.values - last.values)[places] <= _FARTHEST * np.minimum(sd, last_sd)
    ratio = sd / last_sd
    return bool(near.all() and (ratio < _WIDER).all() and (ratio > 1 / _WIDER).all())
