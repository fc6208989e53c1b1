"""The way that somebody took over the ground, to be taken again at another pace."""

from dataclasses import dataclass

import numpy as np

from models.geometry.ground import pixel_from_ground
from models.geometry.rotation import Array
from models.geometry.upright import statures, tops_seen
from models.tracks.scenes import SceneTrack
from studies.faults.view import USUAL_STATURE_M, View, ground_of, seen_again

_SMOOTH_S = 1.0  # nodes of a way are so far apart: noise of the feet is no way
_AROUND = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """A way over the ground: nodes (K, 2) in metres and how far along it each is (K,).

    `interval_s` is the usual time between the track's points, `noise_px` (N, 2) how far its feet
    were from the way in the picture, `tall_m` the person's height, NaN where boxes tell none.
    """

    nodes_m: Array
    along_m: Array
    interval_s: float
    noise_px: Array
    tall_m: float

    @property
    def length_m(self) -> float:
        """From one end to the other."""
        return float(self.along_m[-1])

    def at(self, along_m: Array) -> Array:
        """The ground points (N, 2) so many metres (N,) along the way."""
        return np.stack([np.interp(along_m, self.along_m, axis) for axis in self.nodes_m.T], axis=1)


def way_of(track: SceneTrack, view: View) -> Way | None:
    """The way of a track; None where it is no longer than a metre or not on the ground."""
    own = track.trajectory
    ground, valid = ground_of(track, view)
    if not valid.all() or own.duration_s < _SMOOTH_S:
        return None
    count = max(int(own.duration_s / _SMOOTH_S), 1) + 1
    nodes_s = np.linspace(own.time_s[0], own.time_s[-1], count)
    weight = np.clip(1 - np.abs(own.time_s - nodes_s[:, None]) / _SMOOTH_S, 0, None)
    weight[[0, -1]] = 0.0
    weight[[0, -1], [0, -1]] = 1.0  # the ends are where they are
    empty = weight.sum(axis=1) == 0
    nodes = weight @ ground / np.where(empty, 1.0, weight.sum(axis=1))[:, None]
    nodes, nodes_s = nodes[~empty], nodes_s[~empty]
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] < 1.0:
        return None
    pose, lens = view.pose, view.intrinsics
    there = np.stack([np.interp(own.time_s, nodes_s, axis) for axis in nodes.T], axis=1)
    uv, _ = pixel_from_ground(lens, pose.rotation, pose.centre_m, there)
    tall = np.array([np.nan])
    if own.top_v is not None:
        tall, _ = statures(lens, pose.rotation, pose.height_m, own.uv, own.top_v)
    return Way(
        nodes_m=nodes,
        along_m=along,
        interval_s=float(np.median(np.diff(own.time_s))),
        noise_px=np.nan_to_num(own.uv - uv),
        tall_m=float(np.nanmedian(tall)) if np.isfinite(tall).any() else np.nan,
    )


def taken_again(
    track: SceneTrack, view: View, way: Way, along_m: Array, tall_m: float = np.nan
) -> SceneTrack | None:
    """The track as of somebody so many metres (N,) along its way, a usual interval from one to one.

    It sets out when the track did, with the noise that its feet had there; `tall_m` in metres, as
    the track's person unless given. None where hardly anything of it is seen.
    """
    ground = way.at(along_m)
    pose, lens = view.pose, view.intrinsics
    uv, _ = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
    last = len(way.noise_px) - 1
    rows = np.rint(along_m / way.length_m * last).astype(np.int64)
    # Of points around, one after another: somebody who stands is not of one noise.
    rows = np.clip(rows + np.arange(rows.size) % (2 * _AROUND + 1) - _AROUND, 0, last)
    uv = uv + way.noise_px[rows]
    own = track.trajectory
    tops = None
    if own.top_v is not None:
        tall = tall_m if np.isfinite(tall_m) else way.tall_m
        tall = tall if np.isfinite(tall) else USUAL_STATURE_M
        tops = tops_seen(lens, pose.rotation, pose.centre_m, ground, np.full(len(ground), tall))
    time_s = own.time_s[0] + way.interval_s * np.arange(along_m.size)
    return seen_again(track, view, uv, tops, time_s)
