"""The reference as a value: what is usual at a site, and the joint estimator's offset there.

Ours: pose = estimate - offset, which is learned while the pose is known.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.reasons import Reason
from models.serialization import stored_as
from models.tracks.observations import Observations
from models.walking.config import PLAUSIBLE_OFFSET, POSE_PRIOR_SD
from models.walking.fit import Channel, Learned, PosePrior, learn
from models.walking.heads.reference import HeadReference
from models.walking.measures import measure_speeds, measure_statures


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedReference:
    """People's usual speeds and statures at a site, and the joint estimator's errors there.

    `offset` (3,) is what it says of tilt, roll, log height at the prior pose beyond the truth, with
    `offset_covariance` (3, 3); its variances are to be multiplied by `pose_variance_inflation`.
    `tracks` is 0 where nothing was learned and the speed is assumed. `implausible` is what is
    too far from other sites or the prior pose, `boxes` says why boxes are used or not. `heads` is
    how heads stand over feet; None where too few have heads.
    """

    speeds: Learned
    statures: Learned | None
    offset: Array
    offset_covariance: Array
    pose_variance_inflation: float = stored_as("inflation")
    tracks: int
    implausible: Reason | None
    boxes: str
    heads: HeadReference | None = stored_as("verticals")

    @property
    def walking_speed_mps(self) -> float:
        """The site's usual speed over the ground where people were seen."""
        return float(np.exp(self.speeds.usual))

    @property
    def stature_m(self) -> float | None:
        """The site's usual stature by boxes; None where these are not used."""
        return None if self.statures is None else float(np.exp(self.statures.usual))

    @property
    def information_of_a_track(self) -> Array:
        """Information (3, 3) of one of the tracks on tilt, roll, log height, on average."""
        if not self.tracks:
            return np.zeros((3, 3))
        # The offset's covariance is the reference's own, held by how far off we may be here: what
        # is left of a large offset is somewhat less than what held it.
        held = np.maximum(PLAUSIBLE_OFFSET, np.abs(self.offset))
        known = np.linalg.inv(self.offset_covariance) - np.diag(held**-2.0)
        sizes, axes = np.linalg.eigh((known + known.T) / 2)
        information = np.asarray((axes * np.maximum(sizes, 0.0)) @ axes.T) / self.tracks
        if self.heads is not None:
            information[:2, :2] += self.heads.information_of_a_track
        return information


def channels_of(
    observations: Observations, reference: SpeedReference, prior: CameraPose
) -> list[Channel]:
    """The evidence in a set of tracks: speeds, and statures where boxes tell them."""
    heading = prior.heading_rad
    steps, tops = observations.steps, observations.tops
    found = [
        Channel(
            measure=partial(measure_speeds, steps, heading_rad=heading), learned=reference.speeds
        )
    ]
    if reference.statures is not None and len(tops.rows):
        found.append(
            Channel(
                measure=partial(measure_statures, tops, heading_rad=heading),
                learned=reference.statures,
            )
        )
    return found


def learned_at(
    observations: Observations, prior: CameraPose, blank: SpeedReference, rounds: int
) -> SpeedReference:
    """A reference whose fields are learned of tracks at the prior pose, in so many rounds of EM.

    `blank` says from what, and what the fields may do.
    """
    at = plane_parameters_of(prior)
    speeds = learn(
        measure_speeds(observations.steps, at, prior.heading_rad), blank.speeds, em_rounds=rounds
    )
    statures = None
    if blank.statures is not None:
        tops = measure_statures(observations.tops, at, prior.heading_rad)
        statures = learn(tops, blank.statures, em_rounds=rounds)
    return replace(blank, speeds=speeds, statures=statures)


def pose_prior(prior: CameraPose) -> PosePrior:
    """The weak prior around a prior pose: it holds what the tracks leave free, no more."""
    return PosePrior(mean=plane_parameters_of(prior), sd=POSE_PRIOR_SD)
