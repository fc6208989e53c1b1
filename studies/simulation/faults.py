"""Faults of trackers and passers-by in windows: switched people, hidden feet, riders, rounding."""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.rotation import Array
from models.simulation.walkers import Walks

_REFERENCE_WIDTH_PX = 1920.0  # the width at which pixels are given
_SOONEST = 3  # points before and after a switch


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRange:
    """Ranges, drawn from once for each site.

    Shares of windows: `switched`, of which the later part is another walker's; `hidden`, whose feet
    are lifted by some pixels (at a width of 1920) for a part of it; `riding`, two or three times as
    fast. `rounding_px`, at the picture's own size, is that of all points of half of the sites.
    """

    switched: tuple[float, float] = (0.0, 0.1)
    hidden: tuple[float, float] = (0.0, 0.1)
    hidden_px: tuple[float, float] = (10.0, 80.0)
    riding: tuple[float, float] = (0.0, 0.08)
    rounding_px: tuple[float, float] = (1.0, 4.0)
    rounded_share: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteFaults:
    """The faults of sites (S,): shares, and what points are rounded to; 0 where they are not."""

    switched: Array
    hidden: Array
    riding: Array
    rounding_px: Array


def draw_faults(faults: FaultRange, sites: int, rng: np.random.Generator) -> SiteFaults:
    """The faults of so many sites."""
    rounded = rng.random(sites) < faults.rounded_share
    return SiteFaults(
        switched=rng.uniform(*faults.switched, sites),
        hidden=rng.uniform(*faults.hidden, sites),
        riding=rng.uniform(*faults.riding, sites),
        rounding_px=np.where(rounded, rng.uniform(*faults.rounding_px, sites), 0.0),
    )


def with_faults(
    walks: Walks, sites: SiteFaults, faults: FaultRange, width_px: int, rng: np.random.Generator
) -> Walks:
    """Walks with the faults of their sites; rides need 22 points, the others are as long."""
    uv, lengths, site = walks.uv.copy(), walks.lengths.copy(), walks.pose_idx
    for row in np.flatnonzero(rng.random(len(walks)) < sites.riding[site]):
        stride = int(rng.integers(2, 4))
        ridden = uv[row, : lengths[row] : stride].copy()
        if len(ridden) >= walks.lengths.min():
            uv[row], lengths[row] = np.nan, len(ridden)
            uv[row, : len(ridden)] = ridden
    for row in np.flatnonzero(rng.random(len(walks)) < sites.switched[site]):
        first, last = np.searchsorted(site, [site[row], site[row] + 1])
        other = int(rng.integers(first, last))
        both = min(lengths[row], lengths[other])
        at = int(rng.integers(_SOONEST, both - _SOONEST + 1))
        uv[row, at:both] = uv[other, at:both] + (uv[row, at - 1] - uv[other, at - 1])
        uv[row, both:], lengths[row] = np.nan, both
    for row in np.flatnonzero(rng.random(len(walks)) < sites.hidden[site]):
        begin = int(rng.integers(0, lengths[row]))
        end = int(rng.integers(begin, lengths[row])) + 1
        lifted = rng.uniform(*faults.hidden_px) * width_px / _REFERENCE_WIDTH_PX
        uv[row, begin:end, 1] -= lifted
    coarse = sites.rounding_px[site][:, None, None]
    rounded = np.round(uv / np.where(coarse > 0, coarse, 1.0)) * coarse
    return replace(walks, uv=np.where(coarse > 0, rounded, uv), lengths=lengths)
