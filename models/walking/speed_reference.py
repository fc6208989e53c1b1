"""The reference as a value: what is usual at a site, and the joint estimator's offset there.

Before any track is seen it is how people walk and how tall they are elsewhere.

Ours: pose = estimate - offset, which is learned while the pose is known.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.reasons import Reason
from models.serialization import Format, flattened, from_bytes, restored, stored_as, to_bytes
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.walking import config
from models.walking.field import FieldShape, Learned, assumed, field_over, learn
from models.walking.fit import Channel
from models.walking.heads import HeadReference
from models.walking.measures import Measured, measure_speeds, measure_statures
from models.walking.mixed_model import VarianceComponents


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
        held = np.maximum(config.PLAUSIBLE_OFFSET, np.abs(self.offset))
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


_TOPS_SHAPE = FieldShape(
    level=float(np.log(config.STATURE_M)),
    level_sd=config.STATURE_LEVEL_SD,
    length_m=config.STATURE_LENGTH_M,
    place_sd=config.STATURE_PLACE_SD,
    direction_sd=0.0,
)
_SPEED_COMPONENTS = VarianceComponents(
    between_sd=0.18,
    trend_sd=0.05,
    within_sd=0.11,
    correlation=0.45,
    outlier_share=0.2,
    outlier_mean=float(np.log(0.2)),
    outlier_sd=1.0,
)
_TOP_COMPONENTS = VarianceComponents(
    between_sd=0.06,
    trend_sd=0.02,
    within_sd=0.04,
    correlation=0.5,
    outlier_share=0.05,
    outlier_mean=float(np.log(1.4)),
    outlier_sd=0.5,
)


def assumed_speed_reference(
    observations: Observations, prior: CameraPose, walk: WalkConfig
) -> SpeedReference:
    """A reference by an assumed walking speed alone, with fields over where tracks are.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    if observations.walkers < config.FEWEST_WALKERS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {config.FEWEST_WALKERS} that walk for a few seconds inside the "
            f"image are needed, got {observations.walkers}"
        )
    at = plane_parameters_of(prior)
    relative_sd = walk.speed_sd_mps / walk.speed_mean_mps
    shape = FieldShape(
        level=float(np.log(walk.speed_mean_mps)),
        level_sd=max(relative_sd, config.LEAST_SPEED_LEVEL_SD),
        length_m=config.SPEED_LENGTH_M,
        place_sd=config.SPEED_PLACE_SD,
        direction_sd=config.SPEED_DIRECTION_SD,
    )
    speeds = measure_speeds(observations.steps, at, prior.heading_rad)
    tops = measure_statures(observations.tops, at, prior.heading_rad)
    usable, words = _judge_boxes(tops)
    statures = assumed(field_over(tops, _TOPS_SHAPE), _TOP_COMPONENTS) if usable else None
    return SpeedReference(
        speeds=assumed(field_over(speeds, shape), _SPEED_COMPONENTS),
        statures=statures,
        offset=np.zeros(3),
        offset_covariance=np.zeros((3, 3)),
        pose_variance_inflation=config.ASSUMED_INFLATION,
        tracks=0,
        implausible=None,
        boxes=words,
        heads=None,
    )


def of_levels(reference: SpeedReference) -> SpeedReference:
    """An assumed reference whose speeds and statures are the same all over the picture."""
    levels = [
        None if each is None else assumed(each.field.level_alone(), each.components)
        for each in (reference.speeds, reference.statures)
    ]
    assert levels[0] is not None
    return replace(reference, speeds=levels[0], statures=levels[1])


def _judge_boxes(tops: Measured) -> tuple[bool, str]:
    """True if boxes measure statures, and why (not), in words."""
    owners = np.unique(tops.rows.owner_idx[tops.valid])
    if owners.size < config.FEWEST_BOXED:
        return False, f"boxes of {owners.size} tracks, at least {config.FEWEST_BOXED} are needed"
    usual = np.array(
        [np.median(tops.value[tops.valid & (tops.rows.owner_idx == owner)]) for owner in owners]
    )
    sd = SD_OF_MEDIAN_DEVIATION * float(np.median(np.abs(usual - np.median(usual))))
    tall = f"{float(np.exp(np.median(usual))):.2f} m give or take {100 * sd:.1f} %"
    if sd < config.LEAST_STATURE_SD:
        return False, f"boxes are all of one size ({tall}): drawn, not measured"
    return True, f"boxes say that people are {tall}"


_FORMAT = Format(name="site", version=1)


def reference_to_bytes(reference: SpeedReference) -> bytes:
    """A reference as it is stored, but for what is implausible, which has a column of its own."""
    return to_bytes(_FORMAT, flattened(replace(reference, implausible=None)))


def reference_from_bytes(data: bytes) -> SpeedReference:
    """The reference of `reference_to_bytes`.

    Raises:
        CheckpointError: the bytes are no reference of this format.
    """
    return restored(SpeedReference, from_bytes(_FORMAT, data), implausible=None)
