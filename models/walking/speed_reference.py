"""The reference as a value: what is usual at a site, and how the joint estimator errs there.

Ours: pose = estimate - offset, which is learned while the pose is known.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.reasons import Reason
from models.serialization import stored_as
from models.tracks.observations import Observations
from models.walking.fit import Channel, Learned, PosePrior, learn
from models.walking.heads.reference import VerticalReference
from models.walking.measures import measure_speeds, measure_statures

USUAL_SPEEDS_MPS = (0.7, 2.0)  # medians of sites: 1.05 to 1.43 were seen
USUAL_STATURES_M = (1.4, 2.2)  # of boxes
PLAUSIBLE_OFFSET = np.array([np.radians(1.0), np.radians(1.0), 0.1])  # of ours on most sites
_PRIOR_SD = np.array([np.radians(10), np.radians(10), 0.3])  # tilt, roll, log height


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedReference:
    """What is usual at a site, and how the joint estimator errs there.

    `offset` (3,) is what it says of tilt, roll, log height at the prior pose beyond the truth, with
    `offset_covariance` (3, 3); its variances are to be multiplied by `pose_variance_inflation`.
    `tracks` is 0 where nothing was learned and the speed is assumed. `doubt` is what does not fit
    the prior pose, `boxes` says why boxes are used or not. `verticals` is how heads stand over
    feet; None where too few have heads.
    """

    speeds: Learned
    statures: Learned | None
    offset: Array
    offset_covariance: Array
    pose_variance_inflation: float = stored_as("inflation")
    tracks: int
    doubt: Reason | None = None
    boxes: str = ""
    verticals: VerticalReference | None = None

    @property
    def walking_speed_mps(self) -> float:
        """The site's usual speed over the ground where people were seen."""
        return float(np.exp(self.speeds.usual))

    @property
    def stature_m(self) -> float | None:
        """How tall the boxes say that people are; None where boxes are not used."""
        return None if self.statures is None else float(np.exp(self.statures.usual))

    @property
    def information_of_a_track(self) -> Array:
        """What one of the reference's tracks told (3, 3) of tilt, roll, log height, on average."""
        if not self.tracks:
            return np.zeros((3, 3))
        # The offset's covariance is the reference's own, held by how far off we may be here: what
        # is left of a large offset is somewhat less than what held it.
        held = np.maximum(PLAUSIBLE_OFFSET, np.abs(self.offset))
        known = np.linalg.inv(self.offset_covariance) - np.diag(held**-2.0)
        sizes, axes = np.linalg.eigh((known + known.T) / 2)
        told = np.asarray((axes * np.maximum(sizes, 0.0)) @ axes.T) / self.tracks
        if self.verticals is not None:
            told[:2, :2] += self.verticals.information_of_a_track
        return told


def channels_of(
    observations: Observations, reference: SpeedReference, prior: CameraPose
) -> list[Channel]:
    """The evidence in a set of tracks: speeds, and statures where boxes tell them."""
    heading = prior.heading_rad
    steps, tops = observations.steps, observations.tops
    found = [
        Channel(
            measure=partial(measure_speeds, steps, heading_rad=heading),
            learned=reference.speeds,
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
    """A site whose fields are learned of tracks at the prior pose; the spread in so many rounds.

    `blank` says from what, and what the fields may do.
    """
    at = plane_parameters_of(prior)
    speeds = learn(
        measure_speeds(observations.steps, at, prior.heading_rad),
        blank.speeds,
        spread_rounds=rounds,
    )
    statures = None
    if blank.statures is not None:
        tops = measure_statures(observations.tops, at, prior.heading_rad)
        statures = learn(tops, blank.statures, spread_rounds=rounds)
    return replace(blank, speeds=speeds, statures=statures)


def pose_prior(prior: CameraPose) -> PosePrior:
    """The weak prior around a prior pose: it holds what the tracks leave free, no more."""
    return PosePrior(mean=plane_parameters_of(prior), sd=_PRIOR_SD)
