"""How much larger a site's squared errors are than the curvature says, from its own tracks.

Ours: the mean of e' S^-1 e / 3 over parts of the reference, held out, e being what is off and S its
covariance.
"""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.tracks.observations import Observations, of_tracks
from models.walking.fit import FitStart, fit_pose
from models.walking.speed_reference import (
    SpeedReference,
    channels_of,
    learned_at,
    pose_prior,
)

# Squared errors over predicted variances: before any are seen, and what that guess weighs.
ASSUMED_INFLATION = 3.0
_ASSUMED_INFLATION_WEIGHT = 6.0
_LARGEST_RATIO = 9.0
_FOLDS = 4


def pose_variance_inflation(
    observations: Observations,
    prior: CameraPose,
    blank: SpeedReference,
    site: SpeedReference,
    offset: Array,
) -> float:
    """How much larger a site's squared errors are than predicted, from some times to others.

    The earlier half and the later, the quarters by turns, the eighths and the sixteenths: people
    drawn at random would share their hour, and those who are seen afterwards do not.
    """
    at, blank = plane_parameters_of(prior), _with_spreads(blank, site)
    walkers = np.unique(observations.steps.rows.owner_idx)
    ratios = []
    for fold in range(_FOLDS):
        odd = np.arange(walkers.size) * 2 ** (fold + 1) // walkers.size % 2 == 1
        parts = [of_tracks(observations, walkers[chosen]) for chosen in (~odd, odd)]
        for known, unknown in (parts, parts[::-1]):
            if min(known.walkers, unknown.walkers) < 2:
                continue
            part = learned_at(known, prior, blank, 0)
            channels = channels_of(unknown, part, prior)
            fit = fit_pose(channels, FitStart(candidate=at), pose_prior(prior))
            error = fit.candidate - at - offset
            squared = float(error @ np.linalg.solve(fit.covariance, error)) / 3
            ratios.append(min(squared, _LARGEST_RATIO))
    guess = ASSUMED_INFLATION * _ASSUMED_INFLATION_WEIGHT
    return max(1.0, (sum(ratios) + guess) / (len(ratios) + _ASSUMED_INFLATION_WEIGHT))


def _with_spreads(blank: SpeedReference, site: SpeedReference) -> SpeedReference:
    """The blank site's fields with the learned site's spreads."""
    statures = None
    if blank.statures is not None and site.statures is not None:
        statures = replace(blank.statures, spread=site.statures.spread)
    speeds = replace(blank.speeds, spread=site.speeds.spread)
    return replace(blank, speeds=speeds, statures=statures)
