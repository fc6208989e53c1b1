"""How freely a site's speeds vary by place and direction: as halves of its people can predict.

A field that is freer than the site needs costs every estimate some of its precision.
"""

from dataclasses import replace

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.tracks.observations import Observations, of_tracks
from models.walking.fit import assumed, held_out_log_likelihood
from models.walking.measures import measure_speeds
from models.walking.speed_reference import SpeedReference, learned_at

_FREEDOMS = (0.03, 0.3, 1.0)  # shares of the most that speeds may vary by
_LEAST_GAIN = 1.0  # of the log likelihood, for a freer field to be worth it
_HALVINGS = 2


def as_free_as_told(
    observations: Observations, prior: CameraPose, blank: SpeedReference, seed: int
) -> SpeedReference:
    """A blank site whose speeds may vary as much as its tracks show: one half predicts the other.

    Halves are drawn at random, twice, and each is learned from and predicted by turns.
    """
    rng = np.random.default_rng(seed)
    halves = []
    for _ in range(_HALVINGS):
        order = rng.permutation(observations.tracks)
        first, second = np.array_split(order, 2)
        halves += [(np.sort(first), np.sort(second)), (np.sort(second), np.sort(first))]
    at = plane_parameters_of(prior)
    by_speed = replace(blank, statures=None)
    # One spread for all, so that they differ in what they predict alone.
    spread = learned_at(observations, prior, by_speed, 1).speeds.spread
    best, found = -np.inf, blank
    for freedom in _FREEDOMS:
        field = blank.speeds.field.freer(freedom)
        candidate_site = replace(by_speed, speeds=assumed(field, spread))
        log_likelihood = 0.0
        for known, unknown in halves:
            site = learned_at(of_tracks(observations, known), prior, candidate_site, 0)
            log_likelihood += held_out_log_likelihood(
                measure_speeds(of_tracks(observations, unknown).steps, at, prior.heading_rad),
                site.speeds,
            )
        if log_likelihood > best + _LEAST_GAIN * len(halves):
            best = log_likelihood
            found = replace(blank, speeds=assumed(field, blank.speeds.spread))
    return found
