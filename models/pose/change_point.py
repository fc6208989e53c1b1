"""The change point by speeds, the best place to cut a window in two poses, and a second look at it.

Are there two poses beyond doubt, and how sure is the later one?
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import (
    PARAMETERS,
    PLANE_PARAMETERS,
    CameraPose,
    identifiable_of,
    parameters_apart,
    plane_parameters_of,
)
from models.geometry.rotation import Array, Index
from models.paths.reference import PathReference
from models.pose import config
from models.pose.pose_fit import FusedEstimate
from models.quantiles import chi_squared_above, f_above
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.fit import Channel, Fit, FitStart, fit_pose, per_track, track_log_likelihoods
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

    `prior` has the heading that the camera has by now; so has `warm_start`, the fit of all tracks,
    where a change is hardly suspected: both sides are fitted from there, and as without it if they
    are somewhat apart.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    if observations.tracks < 2 * config.FEWEST_BESIDE:
        return None
    start = FitStart(candidate=plane_parameters_of(prior) + reference.offset)
    if warm_start is not None:
        about = _likeliest(observations, prior, reference, warm_start)
        if about.excess < config.CLEARLY_BELOW:
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
    for _ in range(config.CUT_ROUNDS):
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
    limit = chi_squared_above(config.CHANGE_BY_CHANCE, 3)
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
    if observations.tracks < 2 * config.FEWEST_BESIDE:
        return 0.0
    ratio = _ratios_at(channels_of(observations, reference, prior), at)
    limit = chi_squared_above(config.CHANGE_BY_CHANCE, 3) * reference.pose_variance_inflation
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
    best, place = -np.inf, config.FEWEST_BESIDE
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
    allowed = gain[config.FEWEST_BESIDE : len(gain) - config.FEWEST_BESIDE + 1]
    return config.FEWEST_BESIDE + int(np.argmax(allowed))


def _fit(
    observations: Observations,
    chosen: Index,
    prior: CameraPose,
    reference: SpeedReference,
    start: FitStart,
) -> Fit:
    channels = channels_of(of_tracks(observations, chosen), reference, prior)
    return fit_pose(channels, start, prior)


def moved_beyond_doubt(
    before: FusedEstimate, groups_before: int, after: FusedEstimate, groups_after: int
) -> bool:
    """True if a camera has moved from one estimate to the other.

    Neither chance may have made them so different nor, whoever walked, people's habits. Of few
    groups a covariance is not well known, and chance goes farther. A heading that is not
    identifiable counts for as little as is known of it. There must have been a pose to move from,
    and what has moved the farthest by its standard deviation must be identifiable where it is now:
    the rest may be left open by the few who came since, as the prior's, and is better so than by
    those of before.

    Source: Hotelling 1931, T squared, by the freedom of the smaller part; with habits, whose
    variance is given, a chi square.
    """
    groups = min(groups_before, groups_after)
    posed = set(PLANE_PARAMETERS) <= set(before.identifiable)
    if groups < config.GROUPS_OF_A_COVARIANCE or not posed:
        return False
    offset = parameters_apart(after.values, before.values)
    chance = before.covariance + after.covariance
    habits = chance + 2 * np.diag(config.HABITS)
    farthest = PARAMETERS[int(np.argmax(offset**2 / np.diag(habits)))]
    if farthest not in set(before.identifiable) & set(after.identifiable):
        return False
    parameters, freedom = len(PARAMETERS), groups - len(PARAMETERS)
    highest = f_above(config.MOVED_BY_CHANCE, parameters, freedom)
    limit = parameters * (groups - 1) / freedom * highest
    beyond_chance = float(offset @ np.linalg.solve(chance, offset)) > limit
    beyond_habit = float(offset @ np.linalg.solve(habits, offset)) > chi_squared_above(
        config.MOVED_BY_HABIT, parameters
    )
    return beyond_chance and beyond_habit


def widened(
    before: FusedEstimate,
    after: FusedEstimate,
    walking_groups: int,
    speed_reference: SpeedReference,
    paths: PathReference | None,
) -> FusedEstimate:
    """The estimate after a change with the covariance that it deserves.

    The cut is where it suits the tracks best. One group on its wrong side would move the pose by
    the way between the two poses over the number of groups. And no parameter is surer than so many
    people can make it: few of them, who walk alike, may seem to agree.
    """
    offset = parameters_apart(after.values, before.values) / max(walking_groups, 1)
    floor = least_covariance(walking_groups, speed_reference, paths)
    covariance = _at_least(after.covariance + np.outer(offset, offset), floor)
    determined = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return replace(
        after,
        covariance=covariance,
        identifiable=tuple(name for name in after.identifiable if name in determined),
    )


def least_covariance(
    walking_groups: int, speed_reference: SpeedReference, paths: PathReference | None
) -> Array:
    """The covariance (4, 4) that none of so many groups is below, by the reference's own."""
    information = np.diag([0.0, 0.0, 0.0, config.HEADING_SD**-2])
    information[:3, :3] = speed_reference.information_of_a_track * walking_groups
    if paths is not None:
        information = information + paths.still.information_of_a_group * walking_groups
    floor = 1e-9 * np.trace(information) * np.eye(4)  # what nobody shows is not below anything
    return np.asarray(np.linalg.inv(information + floor)) / config.BETTER_VIEW**2


def _at_least(covariance: Array, floor: Array) -> Array:
    """A covariance (4, 4) whose every direction is at least as wide as the floor's."""
    lower = np.linalg.cholesky(floor)
    back = np.linalg.inv(lower)
    sizes, axes = np.linalg.eigh(back @ covariance @ back.T)
    wide = (lower @ axes) * np.sqrt(np.maximum(sizes, 1.0))
    return np.asarray(wide @ wide.T)
