"""Prediction of the base model for a camera's tracks, beside those of its reference."""

import numpy as np
import torch

from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.regression.averaging import FEWEST_TRACKS
from models.simulation.walkers import WalkConfig
from studies.base_model.features import FEATURES, segment_features, walking
from studies.base_model.network import SetNetwork
from studies.base_model.offsets import moved_by, offset_between
from studies.base_model.segments import Segments
from studies.plane_estimate import PlaneEstimate

_ROUNDS = 4  # looks, each from where the last one ended
_FARTHEST = np.array([0.5, 0.5, 0.8])  # radians of leaning, log height, from the prior
_KNOWN = 384  # segments of the reference that are asked: beyond these it is known well enough
_NUDGE = 1e-4


def base_estimate(
    network: SetNetwork,
    intrinsics: Intrinsics,
    prior: CameraPose,
    seen: Segments,
    reference: Segments | None,
) -> PlaneEstimate:
    """Tilt, roll and log height from all segments at once.

    The segments are looked at from the prior pose, then again from the pose that the network found:
    what is left there is small, where the network is sharpest.

    Args:
        network: the base model.
        intrinsics: of the lens.
        prior: the pose that `reference` was seen from.
        seen: segments of the people now.
        reference: segments of people who walked while the camera stood at its prior pose.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks of people who walk.
    """
    speed = WalkConfig().speed_mean_mps
    known = np.empty((0, FEATURES))
    if reference is not None:
        known = segment_features(reference, intrinsics, prior, prior, speed)
        known = known[walking(known)]
        known = known[:: max(1, -(-len(known) // _KNOWN))]
    pose = prior
    for _ in range(_ROUNDS):
        features = segment_features(seen, intrinsics, pose, prior, speed)
        walks = walking(features)
        tracks = int(np.unique(seen.owner_idx[walks]).size)
        if tracks < FEWEST_TRACKS:
            raise TooFewTrajectoriesError(
                f"tracks: at least {FEWEST_TRACKS} of people who walk are needed, got {tracks}"
            )
        step, sd = _ask(network, features[walks], known)
        offset = offset_between(prior, moved_by(pose, step))
        last, pose = pose, moved_by(prior, np.clip(offset, -_FARTHEST, _FARTHEST))
    slope = _slope(last, step)
    alike = walks.sum() / tracks  # segments of one walk are not as many people
    return PlaneEstimate(
        values=plane_parameters_of(pose),
        covariance=alike * slope @ np.diag(np.square(sd)) @ slope.T,
        tracks=tracks,
    )


def _ask(network: SetNetwork, seen: Array, reference: Array) -> tuple[Array, Array]:
    """The offset (3,) from the pose looked from, and its standard deviations (3,)."""
    with torch.inference_mode():
        mean, log_sd, _ = network(*_set(seen), *_set(reference))
    return mean[0].double().numpy(), np.exp(log_sd[0].double().numpy())


def _set(features: Array) -> tuple[torch.Tensor, torch.Tensor]:
    rows = torch.from_numpy(features.astype(np.float32))[None]
    return rows, torch.ones(rows.shape[:2])


def _slope(pose: CameraPose, offset: Array) -> Array:
    """Derivative (3, 3) of plane parameters by the offset from a pose."""
    nudged = offset + _NUDGE * np.eye(3)
    here = plane_parameters_of(moved_by(pose, offset))
    return np.array(
        [(plane_parameters_of(moved_by(pose, each)) - here) / _NUDGE for each in nudged]
    ).T
