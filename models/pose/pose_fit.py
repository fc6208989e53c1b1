"""The pose that is fitted to some tracks, as values: by speeds, by places too, and a warm start.

From that a window is fitted where the last one ended, or all poses are searched again. Of almost
the same tracks the likelihood has almost the same modes, and Gauss-Newton ends at them wherever
near them it begins. What may have changed with a few new tracks is which mode is the highest, and
whether one pose explains all tracks: any sign of that, and a share of the window that is new since
all poses were searched, leads to the full search.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.geometry.pose import (
    PARAMETERS,
    PLANE_PARAMETERS,
    CameraPose,
    PoseParameters,
    identifiable_of,
)
from models.geometry.rotation import Array
from models.pose import config
from models.reasons import Reason, TracksCode
from models.serialization import Format, flattened, from_bytes, restored, to_bytes
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate
from models.walking.fit import FitStart


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternative:
    """Another pose (4,) that explains the tracks: its weight, among all that do."""

    values: Array
    weight: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `identifiable` names those of tilt, roll, height, heading that the tracks determine; `reason`
    says what is wrong with the paths, if anything. `raw` (4,) is before their bias is taken off;
    None where they had no part: then all is the joint estimate's and the heading the prior pose's.
    `alternatives` are other poses that explain the tracks about as well. `modes`
    (4,) are where the search ended, the best first: `raw`, and what may have to do with the
    covariance. `path_fit` is the sum over walking groups of how well they fit the paths at `raw`,
    in logs, and `prior_loss` how much worse they do at the prior pose, in standard errors;
    `prior_gap` is twice what the log posterior is lower there. `speeds` is where the fit of
    speeds ended with the heading.
    """

    values: Array
    covariance: Array
    identifiable: tuple[str, ...]
    reason: Reason | None
    raw: Array | None = None
    alternatives: tuple[Alternative, ...] = ()
    modes: tuple[Array, ...] = ()
    path_fit: float = 0.0
    prior_loss: float = 0.0
    prior_gap: float = math.inf
    speeds: FitStart | None = None

    @property
    def registered(self) -> bool:
        """True if the paths had a part."""
        return self.raw is not None

    @property
    def paths_changed(self) -> bool:
        """True if people walk on none of the site's paths, wherever the camera looks."""
        return self.reason is not None and self.reason.code == TracksCode.PATHS_CHANGED

    @property
    def paths_differ(self) -> bool:
        """True if people fit the site's paths nowhere, or walk them another way."""
        differ = (TracksCode.PATHS_CHANGED, TracksCode.WAYS_CHANGED)
        return self.reason is not None and self.reason.code in differ

    @property
    def parameters(self) -> PoseParameters:
        """The estimate, named."""
        return PoseParameters.of_array(self.values)

    @property
    def sd(self) -> PoseParameters:
        """The standard deviations, named."""
        return PoseParameters.sd_of_array(self.covariance, self.parameters.height_m)

    @property
    def raw_parameters(self) -> PoseParameters | None:
        """The estimate before the bias is taken off, named."""
        return None if self.raw is None else PoseParameters.of_array(self.raw)


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseFit:
    """The pose of some tracks: `joint` by speeds alone, `fused` by places too."""

    joint: JointEstimate
    fused: FusedEstimate

    @property
    def mean_path_fit(self) -> float:
        """The average fit of a walking group to the paths, in logs."""
        return self.fused.path_fit / max(self.joint.walking_groups, 1)


def by_speeds_alone(
    joint: JointEstimate, prior: CameraPose, reason: Reason | None = None
) -> FusedEstimate:
    """The joint estimate with the prior's heading, which speeds leave open.

    Where people were held against a map and do not fit it, as the `reason` says, they are not the
    reference's people: their speeds are known no better than at any other site.
    """
    covariance = np.zeros((4, 4))
    values, covariance[:3, :3] = joint.values, joint.covariance
    if reason is not None:
        values, covariance[:3, :3] = joint.beside_strangers()
    covariance[3, 3] = config.HEADING_SD**2
    determined = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return FusedEstimate(
        values=np.append(values, prior.heading_rad),
        covariance=covariance,
        identifiable=tuple(name for name in joint.identifiable if name in determined),
        reason=reason,
    )


_FORMAT = Format(name="warm_start", version=3)


@dataclass(frozen=True, slots=True, kw_only=True)
class FullSearch:
    """The last search of all poses and of all places to cut, which found no change.

    `ended_s` (tracks,) is when each of its tracks ended, in order. `suspicion` is how much two
    poses explained speeds better than one when a change was last looked for, in units of the
    limit; `path_fit` how well a walking group fitted the paths. None is made of a window that was
    suspected.
    """

    ended_s: Array
    suspicion: float
    path_fit: float

    @property
    def to_s(self) -> float:
        """The end of the newest of its tracks."""
        return float(self.ended_s[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class RefinedPose:
    """An estimate that the next one is held against.

    `modes` (modes, parameters) is where its search ended, the best first.
    """

    values: Array
    covariance: Array
    modes: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmStart:
    """The start of a next estimate: the pose of almost the same tracks at the same site.

    `joint` is by speeds alone, which determine all that they may; `means` are the coefficients of
    the mixed model's fields there. `fused` is by places too, where they are `registered`: what they
    determine together is `identifiable`, and `reason_code` says what was wrong with the paths.
    `speeds` is where their fit ended with its heading, where there was a single mode. `search` is
    when all other poses were searched. `charted` and `drifts_slowly` are whether the drift chart
    was suspicious, and whether the first map was in use: the next estimate may begin here on the
    same basis alone.
    """

    prior: CameraPose
    joint: RefinedPose
    means: tuple[Array, ...]
    fused: RefinedPose
    registered: bool
    identifiable: tuple[str, ...]
    reason_code: str | None
    search: FullSearch
    speeds: FitStart | None = None
    charted: bool = False
    drifts_slowly: bool = False

    @property
    def speed_starts(self) -> tuple[FitStart, ...]:
        """The modes of the speeds, to be fitted to almost the same tracks."""
        return tuple(
            FitStart(candidate=mode, means=self.means, warm=True) for mode in self.joint.modes
        )

    def suits(self, tracks: Observations) -> bool:
        """True if tracks are so much the same that only its own modes are refined."""
        # Late tracks are as new: a tracker may post yesterday's today.
        new = int((~np.isin(tracks.ended_s, self.search.ended_s)).sum())
        return (
            tracks.tracks >= max(config.WARM_TRACKS, (1 - config.NEW) * self.search.ended_s.size)
            and new <= config.NEW * tracks.tracks
        )

    def is_refined_by(self, found: PoseFit) -> bool:
        """True if a pose that was fitted from here is another version of the same."""
        joint, fused = found.joint, found.fused
        worse = config.WORSE / max(joint.walking_groups, 1)
        return (
            joint.identifiable == PLANE_PARAMETERS
            and fused.identifiable == self.identifiable
            and fused.registered == self.registered
            and _code(fused) == self.reason_code
            and len(fused.modes) == len(self.fused.modes)
            and found.mean_path_fit > self.search.path_fit - worse
            and _is_near(joint, self.joint, PLANE_PARAMETERS)
            and _is_near(fused, self.fused, self.identifiable)
        )

    def is_calm(self, suspicion: float) -> bool:
        """True if tracks are no more suspected of a change than those were that had none."""
        return suspicion <= max(config.SUSPICION, config.MORE_SUSPICION * self.search.suspicion)


def warm_start_of(found: PoseFit, prior: CameraPose, search: FullSearch) -> WarmStart | None:
    """The warm start of a pose; None where the next search has to be a full one anyway."""
    joint, fused = found.joint, found.fused
    if joint.reason is not None or joint.identifiable != PLANE_PARAMETERS:
        return None
    if fused.identifiable[: len(PLANE_PARAMETERS)] != PLANE_PARAMETERS:
        return None
    return WarmStart(
        prior=prior,
        joint=_refined(joint),
        means=joint.means,
        fused=_refined(fused),
        registered=fused.registered,
        identifiable=fused.identifiable,
        reason_code=_code(fused),
        search=search,
        speeds=fused.speeds if len(fused.modes) == 1 else None,
    )


def warm_start_to_bytes(warm_start: WarmStart) -> bytes:
    """A warm start as it is stored with each estimate: some kilobytes."""
    return to_bytes(_FORMAT, flattened(warm_start))


def warm_start_from_bytes(data: bytes) -> WarmStart:
    """The warm start of `warm_start_to_bytes`.

    Raises:
        CheckpointError: the bytes are no warm start of this format.
    """
    return restored(WarmStart, from_bytes(_FORMAT, data))


def _code(fused: FusedEstimate) -> str | None:
    return None if fused.reason is None else str(fused.reason.code)


def _refined(found: JointEstimate | FusedEstimate) -> RefinedPose:
    modes = np.array(found.modes, dtype=np.float64).reshape(-1, found.values.size)
    return RefinedPose(values=found.values, covariance=found.covariance, modes=modes)


def _is_near(
    found: JointEstimate | FusedEstimate, last: RefinedPose, names: tuple[str, ...]
) -> bool:
    """True if the named parameters are as before, and as sure."""
    places = [PARAMETERS.index(name) for name in names]
    sd, last_sd = (np.sqrt(np.diag(each.covariance)[places]) for each in (found, last))
    near = np.abs(found.values - last.values)[places] <= config.FARTHEST * np.minimum(sd, last_sd)
    ratio = sd / last_sd
    return bool(near.all() and (ratio < config.WIDER).all() and (ratio > 1 / config.WIDER).all())
