"""Tilt and roll by heads above feet, as a Gaussian, and its product with that of a pose."""

from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.tracks.observations import HeadFootPairs
from models.walking import config
from models.walking.heads.fitting import column_share, fit_angles
from models.walking.heads.reference import HeadReference

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
