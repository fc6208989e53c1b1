"""Whether an estimate may begin where the last one ended, or has to look at all poses again.

Of almost the same tracks the likelihood has almost the same peaks, and Gauss-Newton ends at them
wherever near them it begins. What may have changed with a few new tracks is which peak is the
highest, and whether one pose explains all tracks: any sign of that, and a share of the window that
is new since all poses were looked at, sends an estimate to the full search.
"""

from dataclasses import dataclass

import numpy as np

from models.estimation.joint.estimate import JointEstimate
from models.estimation.joint.observations import Observations
from models.estimation.parameters import PLANE_PARAMETERS
from models.flow.fusion import FusedEstimate
from models.geometry.pose_parameters import PARAMETERS
from models.geometry.rotation import Array

_FEWEST = 150  # tracks: of fewer a full search is soon made, and each of them counts for much
_NEW = 0.25  # of the window
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
class Known:
    """The pose of almost the same tracks at the same site, and when all others were looked at."""

    posed: Posed
    search: FullSearch


def begins_at(known: Known, tracks: Observations) -> bool:
    """Whether tracks are so much the same that their pose is looked for at the known one alone."""
    joint, fused = known.posed.joint, known.posed.fused
    # Late tracks are as new: a tracker may post yesterday's today.
    new = int((~np.isin(tracks.ended_s, known.search.ended_s)).sum())
    return (
        tracks.tracks >= max(_FEWEST, (1 - _NEW) * known.search.ended_s.size)
        and new <= _NEW * tracks.tracks
        and set(joint.identifiable) == set(PLANE_PARAMETERS)
        and joint.reason is None
        and set(PLANE_PARAMETERS) <= set(fused.identifiable)
    )


def is_as_known(found: Posed, known: Known) -> bool:
    """Whether a pose that was looked for at the known one alone is another version of it."""
    first = known.posed
    return (
        found.joint.identifiable == first.joint.identifiable
        and found.fused.registered == first.fused.registered
        and found.fused.identifiable == first.fused.identifiable
        and _code(found.fused) == _code(first.fused)
        and len(found.fused.ends) == len(first.fused.ends)
        and fit_of(found) > known.search.fit - _WORSE / max(found.joint.walking_groups, 1)
        and _is_near(found.joint.values, found.joint.covariance, first.joint, PLANE_PARAMETERS)
        and _is_near(
            found.fused.values, found.fused.covariance, first.fused, found.fused.identifiable
        )
    )


def is_calm(suspicion: float, known: Known) -> bool:
    """Whether tracks are no more suspected of a change than those were that had none."""
    return suspicion <= max(_SUSPICION, _MORE_SUSPICION * known.search.suspicion)


def fit_of(posed: Posed) -> float:
    """How well a walking group fits the map, in the mean."""
    return posed.fused.fit / max(posed.joint.walking_groups, 1)


def _code(fused: FusedEstimate) -> str | None:
    return None if fused.reason is None else str(fused.reason.code)


def _is_near(
    values: Array,
    covariance: Array,
    other: JointEstimate | FusedEstimate,
    asked: tuple[str, ...],
) -> bool:
    """Whether the parameters asked for are as before, and as sure."""
    places = [PARAMETERS.index(name) for name in asked]
    sd, other_sd = (np.sqrt(np.diag(each)[places]) for each in (covariance, other.covariance))
    near = np.abs(values - other.values)[places] <= _FARTHEST * np.minimum(sd, other_sd)
    ratio = sd / other_sd
    return bool(near.all() and (ratio < _WIDER).all() and (ratio > 1 / _WIDER).all())
