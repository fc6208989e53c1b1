"""The reference of heads at a site, and tilt and roll by heads, less what it explains.

Ours: heads whose leans follow the picture's columns more than the verticals were never seen apart
from the feet, and are not used.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.rotation import Array, Index
from models.serialization import stored_as
from models.tracks.observations import HeadFootPairs
from models.walking import config
from models.walking.head_angles import LeanComponents, column_share, fit_angles, learn_habit
from models.walking.mixed_model import Normal
from models.walking.variance_inflation import shrink_offset, squared_ratio, variance_inflation


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadReference:
    """The stance of people's heads over their feet at a site.

    `at` (2,) is the tilt and roll that it was learned at. `habit` is what is usual: the bias to the
    right, and the lean of who walks to the right (2,), in radians. `column_share` is how far the
    heads follow the picture's columns: 0 where each was measured, 1 where all are right above their
    feet in the picture, with standard deviation `column_share_sd`. `offset` (2,) with
    `offset_covariance` (2, 2) is what the estimate says of tilt and roll beyond the truth; its
    variances are to be multiplied by `variance_inflation`. `information_of_a_track` (2, 2) is what
    one track told, `tracks` how many had heads. Of heads that are not `leaning` only the share
    is said.
    """

    at: Array
    habit: Normal
    components: LeanComponents = stored_as("spread")
    column_share: float
    column_share_sd: float
    offset: Array
    offset_covariance: Array
    variance_inflation: float
    information_of_a_track: Array
    tracks: int

    @property
    def leaning(self) -> bool:
        """True if heads were seen to lean as verticals do, and not as columns."""
        return abs(self.column_share) + 2 * self.column_share_sd < config.COLUMN_SHARE_OF_REFERENCE


def learn_heads(pairs: HeadFootPairs | None, at: Array) -> HeadReference | None:
    """The reference of the heads of a camera at a known tilt and roll (2,).

    None where fewer than 12 tracks have heads. In the order of time: by parts of it comes how far
    errors are larger than they seem.
    """
    if pairs is None or pairs.tracks.size < config.HEADS_OF_REFERENCE:
        return None
    tracks = pairs.tracks
    guess = LeanComponents(between_sd=config.LEAN_BETWEEN_SD, within_sd=config.LEAN_WITHIN_SD)
    habit, components = learn_habit(pairs, at, guess, rounds=config.LEAN_EM_ROUNDS)
    share, share_sd = column_share(pairs, at, components)
    found = HeadReference(
        at=at,
        habit=habit,
        components=components,
        column_share=share,
        column_share_sd=share_sd,
        offset=np.zeros(2),
        offset_covariance=np.zeros((2, 2)),
        variance_inflation=1.0,
        information_of_a_track=np.zeros((2, 2)),
        tracks=int(tracks.size),
    )
    if not found.leaning:
        return found
    whole = fit_angles(pairs, at, habit, components)
    offset = whole.mean - at

    def error_ratio(train: Index, test: Index) -> float:
        usual, _ = learn_habit(pairs.of_tracks(train), at, components, rounds=0)
        fit = fit_angles(pairs.of_tracks(test), at, usual, components)
        return squared_ratio(fit.mean - at - offset, fit.covariance)

    inflation = variance_inflation(tracks, error_ratio, config.HEADS_INFLATION)
    noise = whole.covariance * inflation
    kept, left = shrink_offset(offset, noise, config.HEADS_PLAUSIBLE_OFFSET)
    return replace(
        found,
        column_share_sd=share_sd * float(np.sqrt(inflation)),
        offset=kept,
        offset_covariance=(left + left.T) / 2,
        variance_inflation=inflation,
        information_of_a_track=np.linalg.inv(noise) / tracks.size,
    )


_ANGLES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadEstimate:
    """Tilt and roll (2,) in radians with their covariance (2, 2), the offset taken off.

    `identifiable` says whether heads lean as verticals do there, and not as the picture's columns;
    where they do not, the estimate is of no use. `column_share` is how far they follow columns,
    `tracks` how many had heads.
    """

    values: Array
    covariance: Array
    column_share: float
    identifiable: bool
    tracks: int

    def log_density(self, values: Array, covariance: Array) -> float:
        """The log density of these heads by another Gaussian on tilt and roll, (2,) and (2, 2)."""
        off = self.values - values
        wide = self.covariance + covariance
        squared = float(off @ np.linalg.solve(wide, off))
        return max(-0.5 * squared, config.LEAST_HEAD_LOG_DENSITY) - 0.5 * float(
            np.linalg.slogdet(wide)[1]
        )


def head_estimate(
    pairs: HeadFootPairs | None, reference: HeadReference | None
) -> HeadEstimate | None:
    """Tilt and roll by the heads of tracks; None where heads are missing or were never measured.

    Fewer than 5 tracks with heads tell nothing.
    """
    if pairs is None or reference is None or not reference.leaning:
        return None
    tracks = pairs.tracks.size
    if tracks < config.HEADS_OF_WINDOW:
        return None
    found = fit_angles(pairs, reference.at, reference.habit, reference.components)
    share, share_sd = column_share(pairs, found.mean, reference.components)
    share_sd = share_sd * float(np.sqrt(reference.variance_inflation))
    values = found.mean - reference.offset
    covariance = found.covariance * reference.variance_inflation + reference.offset_covariance
    # As far as heads follow columns, a move seems smaller than it was.
    shorter = max(abs(reference.column_share) - reference.column_share_sd, 0.0)
    move = shorter * (values - reference.at)
    return HeadEstimate(
        values=values,
        covariance=covariance + np.outer(move, move),
        column_share=share,
        identifiable=abs(share) + 2 * share_sd < config.COLUMN_SHARE_OF_WINDOW,
        tracks=int(tracks),
    )


def joined(values: Array, covariance: Array, heads: HeadEstimate) -> tuple[Array, Array]:
    """Values (P,) with a covariance (P, P), tilt and roll first, together with what heads say.

    The product of both Gaussians. Where they are farther apart than their covariances say, neither
    is trusted over the other: the result is less sure by as much, along the line between them.

    Source: Birge 1932, the ratio of external to internal consistency.
    """
    known = covariance[:, :_ANGLES]
    apart = covariance[:_ANGLES, :_ANGLES] + heads.covariance
    gain = known @ np.linalg.inv(apart)
    off = heads.values - values[:_ANGLES]
    moved = gain @ off
    together = covariance - gain @ known.T
    together = (together + together.T) / 2
    ratio = float(off @ np.linalg.solve(apart, off)) / _ANGLES
    if ratio > 1:
        along = float(moved @ np.linalg.solve(together, moved))
        together = together + (ratio - 1) / along * np.outer(moved, moved)
    return values + moved, together
