"""Learn a site from tracks at a known pose: its speeds, its boxes, and our own bias there."""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations, of_tracks
from models.walking.fit import assumed, fit_pose
from models.walking.heads.reference import learn_verticals
from models.walking.reference.assumed import ASSUMED_INFLATION, assumed_speed_reference
from models.walking.reference.doubt import doubt_of
from models.walking.reference.freedom import as_free_as_told
from models.walking.speed_reference import (
    PLAUSIBLE_OFFSET,
    SpeedReference,
    channels_of,
    learned_at,
    pose_prior,
)
from models.walking.variance_inflation import (
    Tracks,
    shrink_offset,
    squared_ratio,
    variance_inflation,
)

_SPREAD_ROUNDS = 5


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
    site = learned_at(observations, prior, blank, _SPREAD_ROUNDS)
    whole = fit_pose(
        channels_of(observations, site, prior), plane_parameters_of(prior), pose_prior(prior)
    )
    offset = whole.candidate - plane_parameters_of(prior)
    inflation = _variance_inflation(observations, prior, blank, site, offset)
    kept, covariance = shrink_offset(offset, whole.covariance * inflation, PLAUSIBLE_OFFSET)
    site = replace(
        site,
        offset=kept,
        offset_covariance=covariance,
        pose_variance_inflation=inflation,
        tracks=observations.walkers,
        verticals=learn_verticals(observations.uprights, plane_parameters_of(prior)[:2]),
    )
    return replace(site, doubt=doubt_of(observations, prior, blank, site))


def _variance_inflation(
    observations: Observations,
    prior: CameraPose,
    blank: SpeedReference,
    site: SpeedReference,
    offset: Array,
) -> float:
    """How much larger squared errors are than predicted, by the variance components of all."""
    at, blank = plane_parameters_of(prior), _with_components(blank, site)

    def error_ratio(train: Tracks, test: Tracks) -> float:
        part = learned_at(of_tracks(observations, train), prior, blank, 0)
        channels = channels_of(of_tracks(observations, test), part, prior)
        fit = fit_pose(channels, at, pose_prior(prior))
        return squared_ratio(fit.candidate - at - offset, fit.covariance)

    walkers = np.unique(observations.steps.rows.owner_idx)
    return variance_inflation(walkers, error_ratio, ASSUMED_INFLATION)


def _with_components(blank: SpeedReference, site: SpeedReference) -> SpeedReference:
    """The blank site's fields with the learned site's variance components."""
    statures = None
    if blank.statures is not None and site.statures is not None:
        statures = replace(blank.statures, spread=site.statures.spread)
    speeds = replace(blank.speeds, spread=site.speeds.spread)
    return replace(blank, speeds=speeds, statures=statures)


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
