"""Links between pieces of one walk: a tracker that loses people gives them new names.

Tracklet association (Huang, Wu and Nevatia 2008) on the ground: a piece follows another where it
begins shortly after the other's end, at the place where that one was bound for, as fast and as
tall. Limits are in the walkers' own speed and in pixels of noise, so that they hold at a pose
that is some way off, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.compiled import compiled
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Index, Mask
from models.geometry.upright import statures
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks import config
from models.tracks.trajectory import Points, Trajectory, points_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """One end of each of N tracks, on the ground at a pose.

    `time_s` (N,) is when, `place` (N, 2) where in metres, with covariance `noise` (N, 2, 2);
    `velocity` (N, 2) in m/s is of `span_s` (N,) around it. `log_tall` (N,) is the log of the
    stature in metres by boxes, NaN where these are not known. What is not `valid` (N,), too few
    points or no ground there, is 0.
    """

    time_s: Array
    place: Array
    velocity: Array
    noise: Array
    span_s: Array
    log_tall: Array
    valid: Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkScale:
    """Values of a whole window by which two of its tracks are linked.

    `usual_mps` is the usual pace, `log_room` the log determinant of the covariance of strangers'
    places and velocities, `rivals` the pairs for each track.
    """

    usual_mps: float
    log_room: float
    rivals: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Links:
    """The piece before (N,) each track, as of `link_pieces`, and the scale of the links.

    The scale is None of tracks of which none begins shortly after the end of another.
    """

    before: Index
    scale: LinkScale | None


def link_pieces(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> Index:
    """The piece before (N,) that each of N tracks goes on; -1 for one that begins a walk.

    One-to-one, the likeliest pair first. Two that are about as likely are both left alone: a piece
    that counts as a person of its own does less harm than two people taken for one. The order in
    which the tracks are given changes nothing.

    `pose` is the camera's prior pose.
    """
    return linked(trajectories, intrinsics, pose).before


def linked(
    trajectories: Sequence[Trajectory],
    intrinsics: Intrinsics,
    pose: CameraPose,
    scale: LinkScale | None = None,
) -> Links:
    """Links of tracks; of a part of a window by the `scale` of the whole."""
    before = np.full(len(trajectories), -1, dtype=np.int64)
    if len(trajectories) < 2:
        return Links(before=before, scale=scale)
    heads, tails = _both_ends(trajectories, intrinsics, pose)
    earlier, later = _pairs(heads, tails)
    if not earlier.size:
        return Links(before=before, scale=scale)
    apart, misfit, scale = _misfit(heads, tails, earlier, later, scale)
    near = (apart <= config.FARTHEST) & (misfit < 0)
    rank = np.argsort(misfit[near], kind="stable")
    earlier, later, misfit = earlier[near][rank], later[near][rank], misfit[near][rank]
    chosen = _clear_links(
        earlier, later, misfit, _of_each(earlier, before.size), _of_each(later, before.size)
    )
    before[later[chosen]] = earlier[chosen]
    return Links(before=before, scale=scale)


def count_walks(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> int:
    """The number of walks that tracks are of: all of them less those that go on another."""
    return int((link_pieces(trajectories, intrinsics, pose) < 0).sum())


def walks_of(before: Index) -> Index:
    """The first track (N,) of the walk of each, by the pieces before them."""
    later = np.flatnonzero(before >= 0)
    return first_of_component(np.stack([before[later], later], axis=1), before.size)


def _pairs(heads: Ends, tails: Ends) -> tuple[Index, Index]:
    """Pairs (P,), (P,) of pieces of which one ends shortly before the other begins."""
    order = np.argsort(heads.time_s, kind="stable")
    starts = heads.time_s[order]
    first = np.searchsorted(starts, tails.time_s, side="right")
    behind = np.searchsorted(starts, tails.time_s + config.PIECE_GAP_S, side="right")
    # The first to come: of a flood of pieces the pairs would be as many as their square.
    number = np.where(tails.valid, np.minimum(behind - first, config.MOST_FOLLOWERS), 0)
    earlier = np.repeat(np.arange(number.size), number)
    place = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    later = order[np.repeat(first, number) + place]
    kept = heads.valid[later] & (earlier != later)
    return earlier[kept], later[kept]


def _misfit(
    heads: Ends, tails: Ends, earlier: Index, later: Index, scale: LinkScale | None
) -> tuple[Array, Array, LinkScale]:
    """Chi squares (P,) of pairs, twice the log odds of strangers against each, and the scale.

    Both velocities foretell where the later piece begins: their mean crosses the gap. Strangers are
    where any two are of which one begins after the other's end.
    """
    gap_s = heads.time_s[later] - tails.time_s[earlier]
    ahead, behind = tails.velocity[earlier], heads.velocity[later]
    paces = np.linalg.norm(ahead, axis=1), np.linalg.norm(behind, axis=1)
    if scale is None:
        usual = float(np.median(np.linalg.norm(tails.velocity[tails.valid], axis=1)))
        usual = max(usual, config.SLOWEST_MPS)
    else:
        usual = scale.usual_mps
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
    if scale is None:
        scale = LinkScale(
            usual_mps=usual,
            log_room=_spread(off, config.STRANGERS_S * usual) + _spread(turn, usual),
            rivals=max(earlier.size / heads.time_s.size, 1.0),
        )
    odds = 2 * np.log(config.STRANGERS * scale.rivals)
    return apart, misfit - scale.log_room + odds, scale


def _of_each(end: Index, count: int) -> tuple[Index, Index]:
    """Pairs (P,) by the piece of theirs, the likeliest first, and where each piece's begin."""
    order = np.argsort(end, kind="stable")
    return order, np.searchsorted(end[order], np.arange(count + 1))


@compiled
def _clear_links(
    earlier: Index,
    later: Index,
    misfit: Array,
    of_earlier: tuple[Index, Index],
    of_later: tuple[Index, Index],
) -> Mask:
    """A mask (P,) of pairs, the likeliest first, that are links: free, and without a free rival.

    Which pairs are still free only ever becomes less, so each piece's likeliest two of them are
    found by going on from where they were: all takes as long as there are pairs.
    """
    linked = np.zeros(earlier.size, dtype=np.bool_)
    goes_on = np.zeros(of_earlier[1].size - 1, dtype=np.bool_)
    gone_on = goes_on.copy()
    places = (of_earlier[1].copy(), of_earlier[1].copy(), of_later[1].copy(), of_later[1].copy())
    for pair in range(earlier.size):
        one, other = earlier[pair], later[pair]
        if goes_on[one] or gone_on[other]:
            continue
        limit = misfit[pair] + config.CLEAR
        if _has_rival(
            pair, limit, misfit, of_earlier, one, places[0], places[1], gone_on, later
        ) or _has_rival(
            pair, limit, misfit, of_later, other, places[2], places[3], goes_on, earlier
        ):
            continue
        linked[pair] = goes_on[one] = gone_on[other] = True
    return linked


@compiled
def _has_rival(
    pair: int,
    limit: float,
    misfit: Array,
    pairs: tuple[Index, Index],
    piece: int,
    first: Index,
    second: Index,
    taken: Mask,
    partner: Index,
) -> bool:
    """True if a free pair of a piece of this free one is likelier, or less likely by too little.

    `first` and `second` (N,) are places of each piece's free pairs, or before them; they are moved.
    """
    order, beyond = pairs[0], pairs[1][piece + 1]
    while taken[partner[order[first[piece]]]]:
        first[piece] += 1
    if order[first[piece]] != pair:
        return True
    second[piece] = max(second[piece], first[piece] + 1)
    while second[piece] < beyond and taken[partner[order[second[piece]]]]:
        second[piece] += 1
    near: bool = second[piece] < beyond and misfit[order[second[piece]]] < limit
    return near


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


def first_of_component(pairs: Index, count: int) -> Index:
    """The first member (count,) of the component of each, by pairs (K, 2) that join two of them."""
    from scipy.sparse import coo_array  # a third of a second, and the HTTP process never asks
    from scipy.sparse.csgraph import connected_components

    one, other = pairs.reshape(-1, 2).T
    graph = coo_array((np.ones(one.size, dtype=np.int8), (one, other)), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    firsts = np.unique(labels, return_index=True)[1]
    return np.asarray(firsts[labels], dtype=np.int64)


def _both_ends(
    trajectories: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> tuple[Ends, Ends]:
    """The first and the last ends of tracks, one at least, as a camera at a pose places them."""
    points = points_of(trajectories)
    heads, tails = (_ends(points, last, intrinsics, pose) for last in (False, True))
    return heads, tails


def _ends(points: Points, last: bool, intrinsics: Intrinsics, pose: CameraPose) -> Ends:
    chosen, owner = _points_at_ends(points.time_s, points.bounds, last)
    at = points.bounds[1:] - 1 if last else points.bounds[:-1]
    count, end_s, uv = at.size, points.time_s[at], points.uv[chosen]
    since_s = points.time_s[chosen] - end_s[owner]
    ground, seen = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, uv)
    ground = np.where(seen[:, None], ground, 0.0)
    number = np.bincount(owner, seen, count)
    enough = np.maximum(number, 1)
    middle_s = np.bincount(owner, seen * since_s, count) / enough
    apart_s = np.where(seen, since_s - middle_s[owner], 0.0)
    moment = np.bincount(owner, apart_s**2, count)
    middle = _sums(owner, ground, count) / enough[:, None]
    velocity = _sums(owner, apart_s[:, None] * ground, count) / np.maximum(moment, 1e-9)[:, None]
    noise, on_ground = _noise(points.uv[at], intrinsics, pose)
    valid = (number >= 2) & (number == np.bincount(owner, minlength=count)) & on_ground
    return Ends(
        time_s=end_s,
        place=np.where(valid[:, None], middle - velocity * middle_s[:, None], 0.0),
        velocity=np.where(valid[:, None], velocity, 0.0),
        noise=np.where(valid[:, None, None], noise, 0.0),
        span_s=np.sqrt(12 * moment / enough),  # of evenly spread times
        log_tall=_log_tall(uv, points.top_v[chosen], owner, count, intrinsics, pose),
        valid=valid,
    )


def _noise(uv: Array, intrinsics: Intrinsics, pose: CameraPose) -> tuple[Array, Mask]:
    """Covariances (N, 2, 2) of the places of feet in pixels (N, 2), and which are on ground."""
    beside = uv.reshape(-1, 1, 2) + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ground, seen = ground_from_pixel(intrinsics, pose.rotation, pose.centre_m, beside)
    by_pixel = np.stack([ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0]], axis=2)
    # A metre across the line of sight is as many pixels as the least that one moves a place.
    metres = np.maximum(np.linalg.svd(np.nan_to_num(by_pixel), compute_uv=False)[:, 1], 1e-9)
    sd_px = np.hypot(config.FOOT_NOISE_PX, config.FOOT_NOISE_M / metres)
    covariance = by_pixel @ np.swapaxes(by_pixel, 1, 2) * sd_px[:, None, None] ** 2
    return covariance, np.asarray(seen.all(axis=1))


def _log_tall(
    uv: Array,
    top_v: Array,
    owner: Index,
    count: int,
    intrinsics: Intrinsics,
    pose: CameraPose,
) -> Array:
    """Logs of statures (N,) by the points of N ends, NaN where there are no boxes."""
    tall = np.full(count, np.nan)
    boxed = np.flatnonzero(np.isfinite(top_v))
    if not boxed.size:
        return tall
    tall_m, known = statures(intrinsics, pose.rotation, pose.height_m, uv[boxed], top_v[boxed])
    number = np.bincount(owner[boxed], known, count)
    logs = np.where(known, np.log(np.where(known, tall_m, 1.0)), 0.0)
    total = np.bincount(owner[boxed], logs, count)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _sums(owner: Index, values: Array, count: int) -> Array:
    columns = [np.bincount(owner, values[:, axis], count) for axis in range(values.shape[1])]
    return np.stack(columns, axis=1)


@compiled
def _points_at_ends(time_s: Array, bounds: Index, last: bool) -> tuple[Index, Index]:
    """Some points (K,) within a time of an end of each track, in time order, and the tracks (K,).

    The end's own point is among them.
    """
    chosen = np.empty(config.END_POINTS * (bounds.size - 1), dtype=np.int64)
    owner = np.empty(chosen.size, dtype=np.int64)
    found = 0
    for track in range(bounds.size - 1):
        first, final = bounds[track], bounds[track + 1] - 1
        usual_s = (time_s[final] - time_s[first]) / max(final - first, 1)
        reach_s = max(config.END_SPAN_S, config.END_USUAL_GAPS * usual_s)
        low, high = first, final
        if last:
            low = final
            while low > first and time_s[low - 1] >= time_s[final] - reach_s:
                low -= 1
        else:
            high = first
            while high < final and time_s[high + 1] <= time_s[first] + reach_s:
                high += 1
        stride = -(-(high - low + 1) // config.END_POINTS)
        number = (high - low) // stride + 1
        begin = high - (number - 1) * stride if last else low
        for place in range(number):
            chosen[found], owner[found] = begin + place * stride, track
            found += 1
    return chosen[:found], owner[:found]
