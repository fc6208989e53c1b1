"""The change point by speeds: the best place to cut a window in two poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.pose import CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.pose.config import CHANGE_BY_CHANCE, CLEARLY_BELOW, CUT_ROUNDS, FEWEST_BESIDE
from models.quantiles import chi_squared_above
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.fit import (
    Channel,
    Fit,
    FitStart,
    fit_pose,
    per_track,
    track_log_likelihoods,
)
from models.walking.speed_reference import SpeedReference, channels_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangePoint:
    """The first track after a move, and how far the two poses are apart: 1 is the limit."""

    track_idx: int
    excess: float


def find_change(
    observations: Observations,
    prior: CameraPose,
    reference: SpeedReference,
    warm_start: FitStart | None = None,
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
        warm_start: the fit of all tracks with that heading, where a change is hardly suspected:
            both sides are fitted from there, and as without it if they are somewhat apart.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    if observations.tracks < 2 * FEWEST_BESIDE:
        return None
    start = FitStart(candidate=plane_parameters_of(prior) + reference.offset)
    if warm_start is not None:
        about = _likeliest(observations, prior, reference, warm_start)
        if about.excess < CLEARLY_BELOW:
            return None
    found = _likeliest(observations, prior, reference, start)
    return found if found.excess > 1 else None


def _likeliest(
    observations: Observations, prior: CameraPose, reference: SpeedReference, start: FitStart
) -> ChangePoint:
    """The likeliest move, whatever its excess."""
    channels = channels_of(observations, reference, prior)
    cut = _first_cut(channels, prior, reference, start)
    before = after = None
    for _ in range(CUT_ROUNDS):
        before = _fit(observations, np.arange(cut), prior, reference, start)
        after = _fit(observations, np.arange(cut, observations.tracks), prior, reference, start)
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
    limit = chi_squared_above(CHANGE_BY_CHANCE, 3)
    excess = float(apart @ np.linalg.solve(covariance, apart)) / limit
    return ChangePoint(track_idx=cut, excess=excess)


def suspicion(
    observations: Observations, prior: CameraPose, reference: SpeedReference, at: Array
) -> float:
    """The gain of two poses over one in explaining the speeds of tracks, in units of the limit.

    By their scores at about the pose of all of them (3,), as `raw`: a likelihood ratio linear in a
    small move, and a tenth of the time of `find_change`. Large moves it makes smaller than they
    are, to a quarter of the excess.
    """
    if observations.tracks < 2 * FEWEST_BESIDE:
        return 0.0
    ratio = _ratios_at(channels_of(observations, reference, prior), at)
    limit = chi_squared_above(CHANGE_BY_CHANCE, 3) * reference.pose_variance_inflation
    return float(ratio[_best_cut(ratio)]) / limit


def _first_cut(
    channels: Sequence[Channel], prior: CameraPose, reference: SpeedReference, start: FitStart
) -> int:
    """The cut with the highest likelihood ratio, by scores at the prior pose or at one for all.

    The first is the better one for a small move, the second where most tracks are after it.
    """
    at_prior = plane_parameters_of(prior) + reference.offset
    whole = start.candidate
    if not start.warm:
        whole = fit_pose(channels, start, prior).candidate
    best, place = -np.inf, FEWEST_BESIDE
    for candidate in (at_prior, whole):
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
    """The place of the highest gain (N,) that leaves enough tracks on both sides."""
    allowed = gain[FEWEST_BESIDE : len(gain) - FEWEST_BESIDE + 1]
    return FEWEST_BESIDE + int(np.argmax(allowed))


def _fit(
    observations: Observations,
    chosen: npt.NDArray[np.int64],
    prior: CameraPose,
    reference: SpeedReference,
    start: FitStart,
) -> Fit:
    channels = channels_of(of_tracks(observations, chosen), reference, prior)
    return fit_pose(channels, start, prior)
