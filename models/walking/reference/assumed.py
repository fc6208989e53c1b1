"""A site of which nothing is known yet: how people walk and how tall their boxes are elsewhere."""

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.walking.field import FieldShape, field_over
from models.walking.fit import assumed
from models.walking.measures import Measured, measure_speeds, measure_statures
from models.walking.mixed_model import Spread
from models.walking.speed_reference import SpeedReference

# Fewer who walk for a few seconds make no estimate, and no reference.
FEWEST_WALKERS = 5
_STATURE_M = 1.7  # people, give or take 4 %; boxes are drawn a little loose
_TOPS_SHAPE = FieldShape(
    level=float(np.log(_STATURE_M)), level_sd=0.06, length_m=8.0, place_sd=0.03, direction_sd=0.0
)
_SPEED_SPREAD = Spread(
    between_sd=0.18,
    trend_sd=0.05,
    within_sd=0.11,
    correlation=0.45,
    outlier_share=0.2,
    outlier_mean=float(np.log(0.2)),
    outlier_sd=1.0,
)
_TOPS_SPREAD = Spread(
    between_sd=0.06,
    trend_sd=0.02,
    within_sd=0.04,
    correlation=0.5,
    outlier_share=0.05,
    outlier_mean=float(np.log(1.4)),
    outlier_sd=0.5,
)
_LEAST_SPEED_SD = 0.15  # of the log of a site's mean: 1.05 to 1.43 m/s were seen where 1.4 is usual
ASSUMED_INFLATION = 3.0  # squared errors over predicted variances
_FEWEST_BOXED = 8
_ONE_SIZE = 0.02  # people differ by 4 %: boxes that differ by less are drawn, not measured


def assumed_speed_reference(
    observations: Observations, prior: CameraPose, walk: WalkConfig
) -> SpeedReference:
    """A site of which nothing is known but an assumed walking speed.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    if observations.walkers < FEWEST_WALKERS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {FEWEST_WALKERS} that walk for a few seconds inside the image are "
            f"needed, got {observations.walkers}"
        )
    at = plane_parameters_of(prior)
    relative_sd = walk.speed_sd_mps / walk.speed_mean_mps
    shape = FieldShape(
        level=float(np.log(walk.speed_mean_mps)),
        level_sd=max(relative_sd, _LEAST_SPEED_SD),
        length_m=6.0,
        place_sd=0.10,
        direction_sd=0.08,
    )
    speeds = measure_speeds(observations.steps, at, prior.heading_rad)
    tops = measure_statures(observations.tops, at, prior.heading_rad)
    usable, words = _judge_boxes(tops)
    statures = assumed(field_over(tops, _TOPS_SHAPE), _TOPS_SPREAD) if usable else None
    return SpeedReference(
        speeds=assumed(field_over(speeds, shape), _SPEED_SPREAD),
        statures=statures,
        offset=np.zeros(3),
        offset_covariance=np.zeros((3, 3)),
        pose_variance_inflation=ASSUMED_INFLATION,
        tracks=0,
        boxes=words,
    )


def _judge_boxes(tops: Measured) -> tuple[bool, str]:
    """Whether boxes tell how tall people are, and why (not), in words."""
    owners = np.unique(tops.rows.owner_idx[tops.valid])
    if owners.size < _FEWEST_BOXED:
        return False, f"boxes of {owners.size} tracks, at least {_FEWEST_BOXED} are needed"
    usual = np.array(
        [np.median(tops.value[tops.valid & (tops.rows.owner_idx == owner)]) for owner in owners]
    )
    spread = SD_OF_MEDIAN_DEVIATION * float(np.median(np.abs(usual - np.median(usual))))
    tall = f"{float(np.exp(np.median(usual))):.2f} m give or take {100 * spread:.1f} %"
    if spread < _ONE_SIZE:
        return False, f"boxes are all of one size ({tall}): drawn, not measured"
    return True, f"boxes say that people are {tall}"
