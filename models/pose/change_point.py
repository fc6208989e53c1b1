"""When a camera moved, as far as its tracks tell: the best place to cut a window in two."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.plane_parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.quantiles import chi_squared_above
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.fit import (
    Channel,
    Fit,
    Near,
    fit_pose,
    per_track,
    track_log_likelihoods,
)
from models.walking.speed_reference import SpeedReference, channels_of, pose_prior

FEWEST_BESIDE = 12  # tracks before and after: fewer do not make a pose of their own
# The share of windows in which two poses from one differ by as much as is suspected of a move; a
# window has a few hundred places to cut, which are far from independent.
_BY_CHANCE = 1e-3
_ROUNDS = 2
_NOT_FAR = 0.8  # of the limit: looked at roughly, it is the same within a few hundredths


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangePoint:
    """The first track after a move, and how far the two poses are apart: 1 is the limit."""

    track_idx: int
    excess: float


def find_change(
    observations: Observations,
    prior: CameraPose,
    reference: SpeedReference,
    near: Near | None = None,
) -> ChangePoint | None:
    """The move within tracks; None where one pose explains them all.

    The scores of the tracks, linear in a small move, say where to cut first (a likelihood ratio
    over all cuts); then both sides are fitted, each track is given to the side that explains it
    better, and the cut moves to where that is most so. The two poses must then differ beyond
    doubt, by their own covariances.

    Args:
        observations: of the tracks.
        prior: where the camera was, with the heading that it has by now.
        reference: how people walk at the site.
        near: the fit of all tracks with that heading, where a change is hardly suspected: both
            sides are looked at roughly from there, and as without it if they are somewhat apart.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    if observations.tracks < 2 * FEWEST_BESIDE:
        return None
    if near is not None and _likeliest(observations, prior, reference, near).excess < _NOT_FAR:
        return None
    found = _likeliest(observations, prior, reference)
    return found if found.excess > 1 else None


def _likeliest(
    observations: Observations,
    prior: CameraPose,
    reference: SpeedReference,
    near: Near | None = None,
) -> ChangePoint:
    """The likeliest move, whatever its excess."""
    cut = _first_cut(observations, prior, reference, near)
    before = after = None
    for _ in range(_ROUNDS):
        before = _fit(observations, np.arange(cut), prior, reference, near)
        after = _fit(observations, np.arange(cut, observations.tracks), prior, reference, near)
        channels = channels_of(observations, reference, prior)
        gain = track_log_likelihoods(channels, after.candidate) - track_log_likelihoods(
            channels, before.candidate
        )
        moved = _best_cut(np.cumsum(gain[::-1])[::-1])
        if moved == cut:
            break
        cut = moved
    assert before is not None
    assert after is not None
    apart = after.candidate - before.candidate
    covariance = (before.covariance + after.covariance) * reference.pose_variance_inflation
    limit = chi_squared_above(_BY_CHANCE, 3)
    excess = float(apart @ np.linalg.solve(covariance, apart)) / limit
    return ChangePoint(track_idx=cut, excess=excess)


def suspicion(
    observations: Observations, prior: CameraPose, reference: SpeedReference, at: Array
) -> float:
    """How much better two poses than one explain the speeds of tracks, in units of the limit.

    By their scores at about the pose of all of them (3,), as `raw`: a likelihood ratio linear in a
    small move, and a tenth of the time of `find_change`. Large moves it makes smaller than they
    are, to a quarter of the excess.
    """
    if observations.tracks < 2 * FEWEST_BESIDE:
        return 0.0
    ratio = _ratios_at(channels_of(observations, reference, prior), at)
    limit = chi_squared_above(_BY_CHANCE, 3) * reference.pose_variance_inflation
    return float(ratio[_best_cut(ratio)]) / limit


def _first_cut(
    observations: Observations, prior: CameraPose, reference: SpeedReference, near: Near | None
) -> int:
    """The cut with the highest likelihood ratio, by scores at the prior pose or at one for all.

    The first is the better one for a small move, the second where most tracks are after it.
    """
    channels = channels_of(observations, reference, prior)
    at_prior = plane_parameters_of(prior) + reference.offset
    whole = near or fit_pose(channels, at_prior, pose_prior(prior)).near
    best, place = -np.inf, FEWEST_BESIDE
    for candidate in (at_prior, whole.raw):
        ratio = _ratios_at(channels, candidate)
        cut = _best_cut(ratio)
        if ratio[cut] > best:
            best, place = float(ratio[cut]), cut
    return place


def _ratios_at(channels: Sequence[Channel], candidate: Array) -> Array:
    """Twice the log likelihood ratio (N,) of cutting before each track, by scores there."""
    sums = per_track(channels, candidate)
    matrix, gradient = np.cumsum(sums.matrix, axis=0), np.cumsum(sums.gradient, axis=0)
    floor = 1e-6 * np.eye(3)

    def explained(matrices: Array, gradients: Array) -> Array:
        solved = np.linalg.solve(matrices + floor, gradients[..., None])[..., 0]
        return np.asarray((solved * gradients).sum(axis=-1))

    ratio = np.full(len(matrix), -np.inf)
    before, after = slice(0, -1), slice(1, None)
    ratio[after] = (
        explained(matrix[before], gradient[before])
        + explained(matrix[-1] - matrix[before], gradient[-1] - gradient[before])
        - explained(matrix[-1], gradient[-1])
    )
    return ratio


def _best_cut(gain: Array) -> int:
    """Where a gain (N,) is highest that leaves enough tracks on both sides."""
    allowed = gain[FEWEST_BESIDE : len(gain) - FEWEST_BESIDE + 1]
    return FEWEST_BESIDE + int(np.argmax(allowed))


def _fit(
    observations: Observations,
    chosen: np.ndarray,
    prior: CameraPose,
    reference: SpeedReference,
    near: Near | None,
) -> Fit:
    channels = channels_of(of_tracks(observations, chosen), reference, prior)
    hold = pose_prior(prior)
    if near is not None:
        return fit_pose(channels, near.raw, hold, near.means, roughly=True)
    return fit_pose(channels, plane_parameters_of(prior) + reference.offset, hold)
