"""Links between pieces of one walk: a tracker that loses people gives them new names.

Tracklet association (Huang, Wu and Nevatia 2008) on the ground: a piece follows another where it
begins shortly after the other's end, at the place where that one was bound for, as fast and as
tall. Limits are in the walkers' own speed and in pixels of noise, so that they hold at a pose
that is some way off, too.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks import config
from models.tracks.components import first_of_component
from models.tracks.ends import Ends, ends_of
from models.tracks.trajectory import Trajectory


def link_pieces(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> npt.NDArray[np.int64]:
    """The piece before (N,) that each of N tracks goes on; -1 for one that begins a walk.

    One-to-one, the likeliest pair first. Two that are about as likely are both left alone: a piece
    that counts as a person of its own does less harm than two people taken for one. The order in
    which the tracks are given changes nothing.

    Args:
        trajectories: of one camera.
        intrinsics: of its lens.
        pose: about where it stands, its prior pose.
    """
    before = np.full(len(trajectories), -1, dtype=np.int64)
    if len(trajectories) < 2:
        return before
    heads, tails = ends_of(trajectories, intrinsics, pose)
    earlier, later = _pairs(heads, tails)
    if not earlier.size:
        return before
    apart, misfit = _misfit(heads, tails, earlier, later)
    near = (apart <= config.FARTHEST) & (misfit < 0)
    rank = np.argsort(misfit[near], kind="stable")
    earlier, later, misfit = earlier[near][rank], later[near][rank], misfit[near][rank]
    free = np.ones(rank.size, dtype=bool)
    for pair in range(rank.size):
        rivals = free & ((earlier == earlier[pair]) | (later == later[pair]))
        if free[pair] and (rivals & (misfit < misfit[pair] + config.CLEAR)).sum() == 1:
            before[later[pair]] = earlier[pair]
            free &= ~rivals
    return before


def count_walks(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> int:
    """The number of walks that tracks are of: all of them less those that go on another."""
    return int((link_pieces(trajectories, intrinsics, pose) < 0).sum())


def walks_of(before: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The first track (N,) of the walk of each, by the pieces before them."""
    later = np.flatnonzero(before >= 0)
    return first_of_component(np.stack([before[later], later], axis=1), before.size)


def _pairs(heads: Ends, tails: Ends) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Pairs (P,), (P,) of pieces of which one ends shortly before the other begins."""
    order = np.argsort(heads.time_s, kind="stable")
    starts = heads.time_s[order]
    first = np.searchsorted(starts, tails.time_s, side="right")
    behind = np.searchsorted(starts, tails.time_s + config.PIECE_GAP_S, side="right")
    number = np.where(tails.valid, behind - first, 0)
    earlier = np.repeat(np.arange(number.size), number)
    place = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    later = order[np.repeat(first, number) + place]
    kept = heads.valid[later] & (earlier != later)
    return earlier[kept], later[kept]


def _misfit(
    heads: Ends, tails: Ends, earlier: npt.NDArray[np.int64], later: npt.NDArray[np.int64]
) -> tuple[Array, Array]:
    """Chi squares (P,) of pairs, and twice the log of how much likelier strangers are than each.

    Both velocities foretell where the later piece begins: their mean crosses the gap. Strangers are
    where any two are of which one begins after the other's end.
    """
    gap_s = heads.time_s[later] - tails.time_s[earlier]
    ahead, behind = tails.velocity[earlier], heads.velocity[later]
    paces = np.linalg.norm(ahead, axis=1), np.linalg.norm(behind, axis=1)
    usual = float(np.median(np.linalg.norm(tails.velocity[tails.valid], axis=1)))
    usual = max(usual, config.SLOWEST_MPS)
    wander = config.WANDER * np.maximum((paces[0] + paces[1]) / 2, config.LEAST_PACE * usual)
    # Of a line through evenly spread points, noise of neighbours being alike.
    jitter = sum(
        end.noise[those] * (2 / np.maximum(end.span_s[those], 0.1) ** 2)[:, None, None]
        for end, those in ((tails, earlier), (heads, later))
    )
    off = heads.place[later] - tails.place[earlier] - gap_s[:, None] * (ahead + behind) / 2
    turn = behind - ahead
    of_place = tails.noise[earlier] + heads.noise[later]
    of_place = of_place + (gap_s**2)[:, None, None] * jitter / 4 + _round(wander * gap_s)
    of_turn = jitter + _round(wander * np.sqrt(1 + gap_s))
    tall = heads.log_tall[later] - tails.log_tall[earlier]
    # Standing, or almost: half the usual pace is as slow as it gets here.
    walked = [np.log(np.maximum(pace, usual / 2)) for pace in paces]
    apart = (
        _square(off, of_place)
        + _square(turn, of_turn)
        + ((walked[1] - walked[0]) / config.PACE_SD) ** 2
        + np.where(np.isfinite(tall), (np.nan_to_num(tall) / config.TALL_SD) ** 2, 0.0)
    )
    misfit = (config.LINK_FREEDOM + 4) * np.log1p(apart / config.LINK_FREEDOM)
    misfit = misfit + np.log(np.linalg.det(of_place) * np.linalg.det(of_turn))
    room = _spread(off, config.STRANGERS_S * usual) + _spread(turn, usual)
    rivals = max(earlier.size / heads.time_s.size, 1.0)
    return apart, misfit - room + 2 * np.log(config.STRANGERS * rivals)


def _round(sd: Array) -> Array:
    """Covariances (P, 2, 2) alike in all directions, of standard deviations (P,)."""
    return np.asarray(np.eye(2) * (sd**2 + 1e-6)[:, None, None])


def _square(off: Array, covariance: Array) -> Array:
    return np.asarray(
        np.einsum("pi,pi->p", off, np.linalg.solve(covariance, off[..., None])[..., 0])
    )


def _spread(off: Array, least: float) -> float:
    """The log determinant of the covariance of offsets (P, 2), at least that of a length."""
    middle = np.median(np.abs(off - np.median(off, axis=0)), axis=0)
    return 2 * float(np.log(np.maximum(SD_OF_MEDIAN_DEVIATION * middle, least)).sum())
