"""The time of a move between two poses: which tracks are of before it, and which of after it.

Ours: with a move before track c, log p(c) = sum of g_i over i >= c, with g_i the log likelihood
ratio of track i at the pose after the move to that at the pose before. Every c is as likely before.
Source: Hinkley 1970 (the likelihood of a change point); Box and Tiao 1968 (tracks that may be of
neither pose bound each g_i).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from models.geometry.rotation import Array
from models.paths.likelihood import walkers_of
from models.pose import config
from models.pose.site import CameraSite
from models.pose.track_likelihoods import place_log_likelihoods, speed_log_likelihoods
from models.tracks.observations import Observations, of_tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedBetween:
    """The tracks before which a camera may have moved, from the `first` to the `last`, by 90 %.

    With `first` 0, it may have moved before all tracks.
    """

    first: int
    last: int


def moved_between(
    tracks: Observations,
    site: CameraSite,
    before: Array,
    after: Array,
    fit: Callable[[Observations], Array] | None = None,
) -> MovedBetween | None:
    """When a camera moved from a pose (4,) to another, in tracks in the order of their ends.

    If tracks from before the move are in the estimate of the pose after it, `fit` estimates that
    pose anew, from the tracks after the likeliest time of the move. None if fewer than
    `config.FEWEST_BESIDE` people may have come after the move: that few do not determine when.
    """
    logs = _log_weights(tracks, site, before, after)
    likeliest = int(np.argmax(logs))
    people = np.unique(tracks.steps.rows.owner_idx)
    if fit is not None and likeliest and (people >= likeliest).sum() >= config.FEWEST_BESIDE:
        later = of_tracks(tracks, np.arange(likeliest, tracks.tracks))
        logs = _log_weights(tracks, site, before, fit(later))
    below = np.cumsum(np.exp(logs - logsumexp(logs)))
    tail = (1 - config.MOVE_TIME_LEVEL) / 2
    first, last = (int(np.searchsorted(below, share)) for share in (tail, 1 - tail))
    enough = (people >= last).sum() >= config.FEWEST_BESIDE
    return MovedBetween(first=first, last=last) if enough else None


def _log_weights(tracks: Observations, site: CameraSite, before: Array, after: Array) -> Array:
    """The log weights (N + 1,) of a move before each track, and of one after all."""
    ratios = _log_ratios(tracks, site, before, after)
    return np.append(np.cumsum(ratios[::-1])[::-1], 0.0)


def _log_ratios(tracks: Observations, site: CameraSite, before: Array, after: Array) -> Array:
    """The log likelihood ratio (N,) of each track after the move to before it, bounded."""
    found = [speed_log_likelihoods(tracks, site, each) for each in (after, before)]
    ratios = found[0] - found[1]
    if site.paths is not None:
        walkers = walkers_of(tracks, before)
        places = place_log_likelihoods(walkers, site, np.stack([after, before]))
        ratios = ratios + places[0] - places[1]
    odd = np.log(config.ODD_TRACKS)
    return np.asarray(np.logaddexp(ratios, odd) - np.logaddexp(0.0, ratios + odd))
