"""The log likelihood of each track at a pose, by its speeds and by its places.

Each is over its variance inflation, so that sums over tracks compare poses.
"""

import math
from dataclasses import replace

import numpy as np

from models.geometry.rotation import Array
from models.paths.likelihood import Walkers
from models.pose.site import CameraSite
from models.tracks.observations import Observations
from models.walking.fit import track_log_likelihoods
from models.walking.speed_reference import channels_of


def speed_log_likelihoods(tracks: Observations, site: CameraSite, candidate: Array) -> Array:
    """The log likelihoods (N,) of the speeds of tracks at a pose (4,)."""
    reference = site.speed_reference
    turned = replace(site.prior, heading_rad=math.remainder(float(candidate[3]), 2 * math.pi))
    channels = channels_of(tracks, reference, turned)
    found = track_log_likelihoods(channels, candidate[:3] + reference.offset)
    return found / reference.pose_variance_inflation


def place_log_likelihoods(walkers: Walkers, site: CameraSite, candidates: Array) -> Array:
    """The log likelihoods (K, N) of the places of walkers at poses (K, 4); the site has paths."""
    assert site.paths is not None
    found = site.paths.model(site.intrinsics).track_log_likelihoods(walkers, candidates)
    return np.asarray(found / site.paths.variance_inflation_for(walkers.people))
