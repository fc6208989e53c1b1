"""Learn a reference from tracks at a known pose: speeds, boxes, and our own bias there."""

from dataclasses import replace

import numpy as np

from models.geometry.pose import CameraPose, plane_parameters_of
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations, of_tracks
from models.walking import config
from models.walking.fit import FitStart, assumed, fit_pose, held_out_log_likelihood
from models.walking.heads.reference import learn_heads
from models.walking.measures import measure_speeds
from models.walking.mixed.variance_inflation import (
    Tracks,
    shrink_offset,
    squared_ratio,
    variance_inflation,
)
from models.walking.reference.assumed import assumed_speed_reference
from models.walking.reference.plausibility import implausibility_of
from models.walking.speed_reference import SpeedReference, channels_of, learned_at, pose_prior


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
    at, weak = plane_parameters_of(prior), pose_prior(prior)
    start = FitStart(candidate=at)
    blank = assumed_speed_reference(observations, prior, walk)
    blank = _cross_validated(observations, prior, blank, seed)
    learned = learned_at(observations, prior, blank, config.EM_ROUNDS)
    whole = fit_pose(channels_of(observations, learned, prior), start, weak)
    offset = whole.candidate - at
    unlearned = _with_components(blank, learned)

    def error_ratio(train: Tracks, test: Tracks) -> float:
        part = learned_at(of_tracks(observations, train), prior, unlearned, 0)
        fit = fit_pose(channels_of(of_tracks(observations, test), part, prior), start, weak)
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
