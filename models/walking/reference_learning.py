"""Learn a reference from tracks at a known pose: speeds, boxes, our own bias; what is doubtful."""

from dataclasses import replace

import numpy as np

from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Index
from models.reasons import Reason, TracksCode
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations, of_tracks
from models.walking import config
from models.walking.estimate import joint_estimate
from models.walking.field import assumed, held_out_log_likelihood
from models.walking.fit import FitStart, fit_pose
from models.walking.heads import learn_heads
from models.walking.measures import measure_speeds
from models.walking.speed_reference import (
    SpeedReference,
    assumed_speed_reference,
    channels_of,
    learned_at,
)
from models.walking.variance_inflation import shrink_offset, squared_ratio, variance_inflation


def learn_speed_reference(
    observations: Observations, prior: CameraPose, walk: WalkConfig, seed: int
) -> SpeedReference:
    """The reference of a site whose camera stands at its prior pose, and our own bias there.

    The bias is what the estimator says of the very tracks that the site was learned from; how far
    its variances fall short is seen by learning from some of the times in which the tracks came and
    estimating from the others, by turns.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    at = plane_parameters_of(prior)
    start = FitStart(candidate=at)
    blank = assumed_speed_reference(observations, prior, walk)
    blank = _cross_validated(observations, prior, blank, seed)
    learned = learned_at(observations, prior, blank, config.EM_ROUNDS)
    whole = fit_pose(channels_of(observations, learned, prior), start, prior)
    offset = whole.candidate - at
    unlearned = _with_components(blank, learned)

    def error_ratio(train: Index, test: Index) -> float:
        part = learned_at(of_tracks(observations, train), prior, unlearned, 0)
        fit = fit_pose(channels_of(of_tracks(observations, test), part, prior), start, prior)
        return squared_ratio(fit.candidate - at - offset, fit.covariance)

    walkers = np.unique(observations.steps.rows.owner_idx)
    inflation = variance_inflation(walkers, error_ratio, config.ASSUMED_INFLATION)
    noise = whole.covariance * inflation
    kept, covariance = shrink_offset(offset, noise, config.PLAUSIBLE_OFFSET)
    reference = replace(
        learned,
        offset=kept,
        offset_covariance=covariance,
        pose_variance_inflation=inflation,
        tracks=observations.walkers,
        heads=learn_heads(observations.heads, at[:2]),
    )
    implausible = implausibility_of(observations, prior, blank, reference)
    return replace(reference, implausible=implausible)


def relearned(
    observations: Observations, prior: CameraPose, reference: SpeedReference
) -> SpeedReference:
    """A reference whose fields are learned of other tracks at the prior pose, by its components.

    What was implausible of the first tracks is not said of these.
    """
    speeds, statures = reference.speeds, reference.statures
    blank = replace(
        reference,
        implausible=None,
        speeds=assumed(speeds.field, speeds.components),
        statures=None if statures is None else assumed(statures.field, statures.components),
    )
    return learned_at(observations, prior, blank, 0)


def _cross_validated(
    observations: Observations, prior: CameraPose, blank: SpeedReference, seed: int
) -> SpeedReference:
    """A blank reference whose speeds may vary as much as its tracks show: halves predict halves.

    Halves are drawn at random, and each is trained by and tested by turns. A field that is freer
    than the site needs costs every estimate some of its precision.
    """
    rng = np.random.default_rng(seed)
    halves = []
    for _ in range(config.HALVINGS):
        first, second = np.array_split(rng.permutation(observations.tracks), 2)
        halves += [(np.sort(first), np.sort(second)), (np.sort(second), np.sort(first))]
    at = plane_parameters_of(prior)
    by_speed = replace(blank, statures=None)
    # The same components for all, so that they differ in what they predict alone.
    components = learned_at(observations, prior, by_speed, 1).speeds.components
    best, found = -np.inf, blank
    for share in config.PRIOR_SHARES:
        field = blank.speeds.field.scaled(share)
        candidate = replace(by_speed, speeds=assumed(field, components))
        log_likelihood = 0.0
        for train, test in halves:
            part = learned_at(of_tracks(observations, train), prior, candidate, 0)
            steps = of_tracks(observations, test).steps
            measured = measure_speeds(steps, at, prior.heading_rad)
            log_likelihood += held_out_log_likelihood(measured, part.speeds)
        if log_likelihood > best + config.LEAST_GAIN * len(halves):
            best = log_likelihood
            found = replace(blank, speeds=assumed(field, blank.speeds.components))
    return found


def _with_components(blank: SpeedReference, learned: SpeedReference) -> SpeedReference:
    """The blank reference's fields with the learned one's variance components."""
    statures = None
    if blank.statures is not None and learned.statures is not None:
        statures = replace(blank.statures, components=learned.statures.components)
    speeds = replace(blank.speeds, components=learned.speeds.components)
    return replace(blank, speeds=speeds, statures=statures)


def implausibility_of(
    observations: Observations, prior: CameraPose, blank: SpeedReference, reference: SpeedReference
) -> Reason | None:
    """A reason that names what is too far off to be a bias; None where nothing is."""
    slow, fast = config.USUAL_SPEEDS_MPS
    speed_mps, stature_m = reference.walking_speed_mps, reference.stature_m
    if not slow <= speed_mps <= fast:
        return Reason(
            code=TracksCode.SPEED_UNUSUAL,
            values={"speed_mps": speed_mps, "slow_mps": slow, "fast_mps": fast},
        )
    short, tall = config.USUAL_STATURES_M
    if stature_m is not None and not short <= stature_m <= tall:
        return Reason(
            code=TracksCode.STATURE_UNUSUAL,
            values={"stature_m": stature_m, "short_m": short, "tall_m": tall},
        )
    inflated = replace(blank, pose_variance_inflation=reference.pose_variance_inflation)
    free = joint_estimate(observations, prior, inflated)
    apart = (free.raw - plane_parameters_of(prior))[:2]
    sigmas = np.abs(apart) / np.sqrt(np.diag(free.covariance))[:2]
    if ((np.abs(apart) > config.DOUBTED_RAD) & (sigmas > config.DOUBTED_SIGMAS)).any():
        tilt, roll = (float(angle) for angle in apart)
        values = {"tilt_rad": tilt, "roll_rad": roll}
        return Reason(code=TracksCode.PRIOR_POSE_DOUBTED, values=values)
    return None
