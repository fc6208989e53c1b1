"""What is read of walks for doors: moments at which each could have begun or ended, and did.

Which they are is decided in the image, so that no candidate pose changes it: a walk that is about
to leave the picture, or a picture that ends by itself, says nothing of doors.

Source: Aalen 1978, events over exposure; that pictures censor walks is ours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.ground import ground_of_rays
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.geometry.vectors import norm
from models.tracks.trajectory import Trajectory, points_of

BEGINS, ENDS = 0, 1
_STEP_S = 0.75  # a walker's metre
_LONGEST_S = 1.5  # of a gap between points counts
_AROUND = 2  # moments on either side that a velocity is of
_STANDING_MPS = 0.35
_AHEAD_S = 1.5  # who would be outside by then is leaving the picture
_MARGIN = 0.25  # of a person's height in the image: half a person's width
_STATURE_M = 1.7
# Where two and more begin, or end, in one frame, and at least half of those in the picture, it is
# the tracker or the recording that does.
_FRAME_S = 0.1
_MOST_AT_ONCE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """M moments of walks: rays (M, 3), z = 1, of feet; `owner_idx` (M,) are the tracks, ascending.

    For `seconds` (M, 2) a walk could have begun, or ended, and not by leaving the picture.
    `event` (M,) is 0 where one begins, 1 where one ends, -1 elsewhere; events have no seconds.
    `log_size` (M,) is the log of how tall in pixels a person is there, about. `owners` is the
    number of tracks, with and without moments.
    """

    rays: Array
    owner_idx: npt.NDArray[np.int64]
    seconds: Array
    event: npt.NDArray[np.int64]
    log_size: Array
    owners: int

    def __len__(self) -> int:
        return int(self.owner_idx.size)

    @property
    def events(self) -> int:
        """How many walks begin or end in sight."""
        return int((self.event >= 0).sum())

    def of_tracks(self, chosen: npt.NDArray[np.int64]) -> "Moments":
        """Those of some tracks only, given by ascending indices, which are numbered anew."""
        renumber = np.full(self.owners, -1)
        renumber[chosen] = np.arange(chosen.size)
        return self._where(renumber[self.owner_idx] >= 0, renumber, int(chosen.size))

    def of_owners(self, owners: npt.NDArray[np.int64]) -> "Moments":
        """Those of some tracks only, which keep their numbers."""
        kept = np.zeros(self.owners, dtype=bool)
        kept[owners] = True
        return self._where(kept[self.owner_idx], np.arange(self.owners), self.owners)

    def _where(self, kept: Mask, renumber: npt.NDArray[np.int64], owners: int) -> "Moments":
        return Moments(
            rays=np.ascontiguousarray(self.rays[kept]),
            owner_idx=renumber[self.owner_idx[kept]],
            seconds=np.ascontiguousarray(self.seconds[kept]),
            event=self.event[kept],
            log_size=self.log_size[kept],
            owners=owners,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nodes:
    """Means of 0.75 s of walks each: whose, when, where in pixels; each walk's first and last."""

    owner_idx: npt.NDArray[np.int64]
    time_s: Array
    uv: Array
    first: npt.NDArray[np.int64]
    last: npt.NDArray[np.int64]


def observe_moments(
    walks: Sequence[Trajectory], intrinsics: Intrinsics, pose: CameraPose
) -> Moments:
    """The moments of walks that are long enough, and when they began and ended in sight.

    Args:
        walks: of one camera; what is not one, a point, is passed over.
        intrinsics: of its lens.
        pose: about where it stands, its prior pose: it says who stands, and how tall people are.
    """
    owners = [number for number, walk in enumerate(walks) if walk.long_enough]
    nodes = _nodes([walks[number] for number in owners], np.array(owners, dtype=np.int64))
    before = np.maximum(np.arange(nodes.time_s.size) - _AROUND, nodes.first)
    behind = np.minimum(np.arange(nodes.time_s.size) + _AROUND, nodes.last)
    span_s = np.maximum(nodes.time_s[behind] - nodes.time_s[before], 1e-3)
    velocity = (nodes.uv[behind] - nodes.uv[before]) / span_s[:, None]
    rays, _ = intrinsics.rays(nodes.uv)
    ground, on_ground = ground_of_rays(rays, pose.rotation, beyond=0.0)
    ground = pose.height_m * ground
    pace = norm(ground[behind] - ground[before]) / span_s
    size_px = intrinsics.fy * _STATURE_M / np.hypot(norm(ground), pose.height_m)
    walked = on_ground & on_ground[before] & on_ground[behind] & (pace > _STANDING_MPS)
    in_sight = np.stack(
        [
            walked & _inside(intrinsics, nodes.uv + sign * _AHEAD_S * velocity, size_px)
            for sign in (-1, 1)
        ],
        axis=1,
    )
    in_sight &= _inside(intrinsics, nodes.uv, size_px)[:, None]
    exposed = in_sight.any(axis=1)
    ends = [nodes.first == np.arange(nodes.first.size), nodes.last == np.arange(nodes.last.size)]
    told = _by_themselves([walks[number] for number in owners])
    events = [
        np.flatnonzero(end)[told[kind] & in_sight[end, kind]] for kind, end in enumerate(ends)
    ]
    chosen = np.concatenate([np.flatnonzero(exposed), *events])
    seconds = in_sight[exposed] * _seconds(nodes)[exposed, None]
    number = [int(exposed.sum()), *(kind.size for kind in events)]
    seconds = np.concatenate([seconds, np.zeros((number[1] + number[2], 2))])
    order = np.argsort(nodes.owner_idx[chosen], kind="stable")
    chosen = chosen[order]
    return Moments(
        rays=np.ascontiguousarray(rays[chosen]),
        owner_idx=nodes.owner_idx[chosen],
        seconds=seconds[order],
        event=np.repeat(np.array([-1, BEGINS, ENDS]), number)[order],
        log_size=np.log(size_px[chosen]),
        owners=len(walks),
    )


def _nodes(walks: Sequence[Trajectory], owners: npt.NDArray[np.int64]) -> _Nodes:
    if not walks:
        none = np.empty(0, dtype=np.int64)
        return _Nodes(
            owner_idx=none, time_s=np.empty(0), uv=np.empty((0, 2)), first=none, last=none
        )
    points = points_of(walks)
    time_s, uv = points.time_s, points.uv
    walk_idx = np.repeat(np.arange(len(walks)), np.diff(points.bounds))
    since_s = time_s - time_s[points.bounds[:-1]][walk_idx]
    span = np.floor(since_s / _STEP_S).astype(np.int64)
    begin = np.flatnonzero(np.append(True, (np.diff(walk_idx) > 0) | (np.diff(span) > 0)))
    number = np.diff(np.append(begin, time_s.size))
    origin_s = time_s[0]  # sums of epoch seconds lose digits
    of_walk = walk_idx[begin]
    first = np.searchsorted(of_walk, of_walk, side="left")
    return _Nodes(
        owner_idx=owners[of_walk],
        time_s=origin_s + np.add.reduceat(time_s - origin_s, begin) / number,
        uv=np.add.reduceat(uv, begin, axis=0) / number[:, None],
        first=first,
        last=np.searchsorted(of_walk, of_walk, side="right") - 1,
    )


def _seconds(nodes: _Nodes) -> Array:
    """For how long (K,) each node stands: half of the way to the nodes around it."""
    same = np.diff(nodes.owner_idx) == 0
    half_s = np.where(same, np.minimum(np.diff(nodes.time_s), _LONGEST_S), 0.0) / 2
    return np.asarray(np.append(half_s, 0.0) + np.append(0.0, half_s))


def _inside(intrinsics: Intrinsics, uv: Array, size_px: Array) -> Mask:
    margin = _MARGIN * size_px
    u, v = uv.T
    return np.asarray(
        (u > margin)
        & (v > margin)
        & (u < intrinsics.width - 1 - margin)
        & (v < intrinsics.height - 1 - margin)
    )


def _by_themselves(walks: Sequence[Trajectory]) -> tuple[Mask, Mask]:
    """Which walks begin, and which end (N,), by themselves: not with the recording.

    Only who is there at the time has a say, so that it matters not which days are at hand together.
    """
    if not walks:
        return np.empty(0, dtype=bool), np.empty(0, dtype=bool)
    began, ended = (np.array([walk.time_s[at] for walk in walks]) for at in (0, -1))
    starts, stops = np.sort(began), np.sort(ended)
    told = []
    for own, times in ((began, starts), (ended, stops)):
        at_once = _number_below(times, own + _FRAME_S) - _number_below(times, own - _FRAME_S)
        there = _number_below(starts, own + _FRAME_S) - _number_below(stops, own - _FRAME_S)
        told.append((at_once == 1) | (at_once < _MOST_AT_ONCE * there))
    return told[0], told[1]


def _number_below(times: Array, limits: Array) -> npt.NDArray[np.int64]:
    """How many of ascending times are below each limit (N,)."""
    return np.searchsorted(times, limits, side="left")
