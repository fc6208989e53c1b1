"""The averaged estimate: the mean of what a regressor says of each track."""

from dataclasses import dataclass

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import PoseParameters
from models.geometry.rotation import (
    Array,
    Index,
    angles_from_rotation,
    mean_quaternion,
    rotation_from_quaternion,
)

FEWEST_TRACKS = 5
_RESAMPLES = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPredictions:
    """Predictions of a regressor for N tracks: heights (N,) in metres, quaternions wxyz (N, 4)."""

    height_m: Array
    quaternion_wxyz: Array

    def __len__(self) -> int:
        return int(self.height_m.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseEstimate:
    """Height, tilt and roll from tracks, with their standard deviations.

    The heading is that of the averaged orientation. It is no measurement (a ground plane and
    walking people do not show it) but part of the paper's angle error.
    """

    value: PoseParameters
    sd: PoseParameters
    tracks: int


def average_windows(
    height_m: Array, quaternion_wxyz: Array, owner_idx: Index
) -> tuple[Index, TrackPredictions]:
    """One prediction for each track that has windows: their owners, and the means.

    Heights (B,) and quaternions (B, 4) are of windows, `owner_idx` (B,) says of which track.
    """
    owners = np.unique(owner_idx)
    rows = [np.flatnonzero(owner_idx == owner) for owner in owners]
    heights = np.array([height_m[row].mean() for row in rows])
    quaternions = np.array([mean_quaternion(quaternion_wxyz[row]) for row in rows]).reshape(-1, 4)
    return owners, TrackPredictions(height_m=heights, quaternion_wxyz=quaternions)


def averaged_estimate(predictions: TrackPredictions, seed: int) -> PoseEstimate:
    """The mean over tracks, with standard deviations by bootstrap over tracks.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks.

    Source: Xu et al. 2020, section 3.4; orientations by Markley 2007.
    """
    count = len(predictions)
    if count < FEWEST_TRACKS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {FEWEST_TRACKS} with a prediction are needed, got {count}"
        )
    # A resample is a weight for each track: how often it was drawn.
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), _RESAMPLES)
    weights = np.concatenate([np.ones((1, count)), drawn])
    heights = weights @ predictions.height_m / count
    means = mean_quaternion(
        np.broadcast_to(predictions.quaternion_wxyz, (len(weights), count, 4)), weights
    )
    tilts, rolls, headings = angles_from_rotation(rotation_from_quaternion(means))
    return PoseEstimate(
        value=PoseParameters(
            height_m=float(heights[0]),
            tilt_rad=float(tilts[0]),
            roll_rad=float(rolls[0]),
            heading_rad=float(headings[0]),
        ),
        sd=PoseParameters(
            height_m=float(heights[1:].std(ddof=1)),
            tilt_rad=float(tilts[1:].std(ddof=1)),
            roll_rad=float(_around(rolls[1:], rolls[0]).std(ddof=1)),
            heading_rad=float(_around(headings[1:], headings[0]).std(ddof=1)),
        ),
        tracks=count,
    )


def _around(angles: Array, centre: float) -> Array:
    """Angles moved by whole turns to lie within half a turn of a centre."""
    return np.asarray((angles - centre + np.pi) % (2 * np.pi) - np.pi)
