"""The reference before any track is seen: how people walk and how tall they are elsewhere."""

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import CameraPose, plane_parameters_of
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.walking import config
from models.walking.field import FieldShape, field_over
from models.walking.fit import assumed
from models.walking.measures import Measured, measure_speeds, measure_statures
from models.walking.mixed.model import VarianceComponents
from models.walking.speed_reference import SpeedReference

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
