"""Learn a site from tracks at a known pose: its speeds, its boxes, and our own bias there.

Ours: the offset is shrunk by its own noise, K = P (P + S)^-1 for a plausible P and its covariance
S, where P is as large as the offset itself asks for (empirical Bayes: Morris 1983); the variance
inflation is the mean of e' S^-1 e / 3 over parts of the reference, held out.
"""

from dataclasses import replace

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.field import FieldShape, field_over
from models.estimation.joint.fit import assumed, fit_pose
from models.estimation.joint.hierarchy import Spread
from models.estimation.joint.measures import Measured, measure_speeds, measure_statures
from models.estimation.joint.observations import Observations, of_tracks
from models.estimation.joint.speed_reference import (
    PLAUSIBLE_OFFSET,
    USUAL_SPEEDS_MPS,
    USUAL_STATURES_M,
    SpeedReference,
    channels_of,
    learned_at,
    pose_prior,
)
from models.estimation.parameters import plane_parameters_of
from models.estimation.reference.freedom import as_free_as_told
from models.estimation.reference.stairs import with_room_for_stairs
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.reasons import Reason, TracksCode
from models.simulation.walkers import WalkConfig
from models.verticals.reference import learn_verticals

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
_SPREAD_ROUNDS = 5
_FEWEST_BOXED = 8
_ONE_SIZE = 0.02  # people differ by 4 %: boxes that differ by less are drawn, not measured
_DOUBT_RAD = float(np.radians(4.0))
_DOUBT_SIGMAS = 4.0
_FOLDS = 4
# Squared errors over predicted variances: before any are seen, and what that guess weighs.
_ASSUMED_INFLATION = 3.0
_ASSUMED_INFLATION_WEIGHT = 6.0
_LARGEST_RATIO = 9.0


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
        pose_variance_inflation=_ASSUMED_INFLATION,
        tracks=0,
        boxes=words,
    )


def learn_speed_reference(
    observations: Observations, prior: CameraPose, walk: WalkConfig, seed: int
) -> SpeedReference:
    """What is usual at a site whose camera stands at its prior pose, and our own bias there.

    The bias is what the estimator says of the very tracks that the site was learned from; how far
    its variances fall short is seen by learning from some of the times in which the tracks came and
    estimating from the others, by turns.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    blank = assumed_speed_reference(observations, prior, walk)
    blank = as_free_as_told(observations, prior, blank, seed)
    blank = with_room_for_stairs(observations, prior, blank)
    site = learned_at(observations, prior, blank, _SPREAD_ROUNDS)
    whole = fit_pose(
        channels_of(observations, site, prior), plane_parameters_of(prior), pose_prior(prior)
    )
    offset = whole.candidate - plane_parameters_of(prior)
    inflation = _pose_variance_inflation(observations, prior, _with_spreads(blank, site), offset)
    kept, covariance = shrink_offset(offset, whole.covariance * inflation)
    site = replace(
        site,
        offset=kept,
        offset_covariance=covariance,
        pose_variance_inflation=inflation,
        tracks=observations.walkers,
        verticals=learn_verticals(observations.uprights, plane_parameters_of(prior)[:2]),
    )
    return replace(site, doubt=_doubt(observations, prior, blank, site))


def shrink_offset(offset: Array, noise: Array) -> tuple[Array, Array]:
    """What is kept of an offset (3,) of a covariance (3, 3), and what is not known of that.

    A bias is of a degree or so, and what the tracks leave free is not taken for one; but where
    they leave no doubt, people walk unlike those of most sites, and it is a large one.
    """
    plausible = np.diag(np.maximum(PLAUSIBLE_OFFSET**2, offset**2 - np.diag(noise)))
    kept = plausible @ np.linalg.inv(plausible + noise)
    return kept @ offset, kept @ noise


def relearned(
    observations: Observations, prior: CameraPose, site: SpeedReference
) -> SpeedReference:
    """A site whose fields are learned of other tracks at the prior pose, by the spread it has.

    What was doubted of the first tracks is not said of these.
    """
    blank = replace(
        site,
        doubt=None,
        speeds=assumed(site.speeds.field, site.speeds.spread),
        statures=None
        if site.statures is None
        else assumed(site.statures.field, site.statures.spread),
    )
    return learned_at(observations, prior, blank, 0)


def _doubt(
    observations: Observations, prior: CameraPose, blank: SpeedReference, site: SpeedReference
) -> Reason | None:
    """What of a reference is too far off to be a bias; None where nothing is."""
    slow, fast = USUAL_SPEEDS_MPS
    if not slow <= site.walking_speed_mps <= fast:
        return Reason(
            code=TracksCode.SPEED_UNUSUAL,
            values={"speed_mps": site.walking_speed_mps, "slow_mps": slow, "fast_mps": fast},
        )
    short, tall = USUAL_STATURES_M
    if site.stature_m is not None and not short <= site.stature_m <= tall:
        return Reason(
            code=TracksCode.STATURE_UNUSUAL,
            values={"stature_m": site.stature_m, "short_m": short, "tall_m": tall},
        )
    inflated = replace(blank, pose_variance_inflation=site.pose_variance_inflation)
    free = joint_estimate(observations, prior, inflated)
    apart = (free.raw - plane_parameters_of(prior))[:2]
    sigmas = np.abs(apart) / np.sqrt(np.diag(free.covariance))[:2]
    if ((np.abs(apart) > _DOUBT_RAD) & (sigmas > _DOUBT_SIGMAS)).any():
        tilt, roll = (float(angle) for angle in apart)
        values = {"tilt_rad": tilt, "roll_rad": roll}
        return Reason(code=TracksCode.PRIOR_POSE_DOUBTED, values=values)
    return None


def _with_spreads(blank: SpeedReference, site: SpeedReference) -> SpeedReference:
    """The blank site's fields with the learned site's spreads."""
    statures = None
    if blank.statures is not None and site.statures is not None:
        statures = replace(blank.statures, spread=site.statures.spread)
    speeds = replace(blank.speeds, spread=site.speeds.spread)
    return replace(blank, speeds=speeds, statures=statures)


def _pose_variance_inflation(
    observations: Observations, prior: CameraPose, blank: SpeedReference, offset: Array
) -> float:
    """How much larger squared errors are than predicted, from some of its times to others.

    The earlier half and the later, the quarters by turns, the eighths and the sixteenths: people
    drawn at random would share their hour, and those who are seen afterwards do not.
    """
    at = plane_parameters_of(prior)
    walkers = np.unique(observations.steps.rows.owner_idx)
    ratios = []
    for fold in range(_FOLDS):
        odd = np.arange(walkers.size) * 2 ** (fold + 1) // walkers.size % 2 == 1
        parts = [of_tracks(observations, walkers[chosen]) for chosen in (~odd, odd)]
        for known, unknown in (parts, parts[::-1]):
            if min(known.walkers, unknown.walkers) < 2:
                continue
            site = learned_at(known, prior, blank, 0)
            fit = fit_pose(channels_of(unknown, site, prior), at, pose_prior(prior))
            error = fit.candidate - at - offset
            squared = float(error @ np.linalg.solve(fit.covariance, error)) / 3
            ratios.append(min(squared, _LARGEST_RATIO))
    guess = _ASSUMED_INFLATION * _ASSUMED_INFLATION_WEIGHT
    return max(1.0, (sum(ratios) + guess) / (len(ratios) + _ASSUMED_INFLATION_WEIGHT))


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
