"""Learn a site from tracks at a known pose: its speeds, its boxes, and our own bias there.

Ours: the offset is shrunk by its own noise, K = P (P + S)^-1 for a plausible P and its covariance
S, where P is as large as the offset itself asks for (empirical Bayes: Morris 1983).
"""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.walking.fit import FitStart, assumed, fit_pose
from models.walking.heads.reference import learn_verticals
from models.walking.reference.assumed import assumed_speed_reference
from models.walking.reference.doubt import doubt_of
from models.walking.reference.freedom import as_free_as_told
from models.walking.reference.inflation import pose_variance_inflation
from models.walking.speed_reference import (
    PLAUSIBLE_OFFSET,
    SpeedReference,
    channels_of,
    learned_at,
    pose_prior,
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
    at = plane_parameters_of(prior)
    channels = channels_of(observations, site, prior)
    whole = fit_pose(channels, FitStart(candidate=at), pose_prior(prior))
    offset = whole.candidate - at
    inflation = pose_variance_inflation(observations, prior, blank, site, offset)
    kept, covariance = shrink_offset(offset, whole.covariance * inflation)
    site = replace(
        site,
        offset=kept,
        offset_covariance=covariance,
        pose_variance_inflation=inflation,
        tracks=observations.walkers,
        verticals=learn_verticals(observations.uprights, plane_parameters_of(prior)[:2]),
    )
    return replace(site, doubt=doubt_of(observations, prior, blank, site))


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
