"""The pose that is fitted to some tracks, as values: by speeds alone, and by places too."""

from dataclasses import dataclass

import numpy as np

from models.geometry.pose import PARAMETERS, CameraPose, PoseParameters, identifiable_of
from models.geometry.rotation import Array
from models.pose.config import HEADING_SD, NARROW
from models.reasons import Reason
from models.walking.estimate import JointEstimate
from models.walking.fit import FitStart


@dataclass(frozen=True, slots=True, kw_only=True)
class PathNeighbourhood:
    """The neighbourhood of the only mode, about the same for almost the same tracks.

    `speeds` is where the fit of speeds ended with its heading. `extra_covariance` (4, 4) was added
    for other modes, for a posterior that is no Gaussian, and for halves of the people that find
    other headings.
    """

    speeds: FitStart
    extra_covariance: Array

    def is_narrow(self, covariance: Array) -> bool:
        """True if so little of a covariance (4, 4) was added that it need not be computed anew."""
        return float(self.extra_covariance[3, 3]) < NARROW * float(covariance[3, 3])


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `identifiable` names those of tilt, roll, height, heading that the tracks determine; `reason`
    says what is wrong with the paths, if anything. `raw` (4,) is before their bias is taken off;
    None where they had no part: then all is the joint estimate's and the heading the prior pose's.
    `rivals` are headings (radians) of other poses that explain the tracks about as well. `modes`
    (4,) are where the search ended, the best first: `raw`, and what may have to do with the
    covariance. `path_fit` is the sum over walking groups of how well they fit the paths at `raw`,
    in logs.
    """

    values: Array
    covariance: Array
    identifiable: tuple[str, ...]
    reason: Reason | None
    raw: Array | None = None
    rivals: tuple[float, ...] = ()
    modes: tuple[Array, ...] = ()
    path_fit: float = 0.0
    neighbourhood: PathNeighbourhood | None = None

    @property
    def registered(self) -> bool:
        """True if the paths had a part."""
        return self.raw is not None

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
    covariance[3, 3] = HEADING_SD**2
    determined = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return FusedEstimate(
        values=np.append(values, prior.heading_rad),
        covariance=covariance,
        identifiable=tuple(name for name in joint.identifiable if name in determined),
        reason=reason,
    )
