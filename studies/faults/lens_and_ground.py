"""A ground that is no plane, and a lens that is not the one that was configured."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.geometry.upright import statures
from models.tracks.scenes import SceneTrack
from studies.faults.view import View, ground_of, seen_again

_STAIRS_GRADE = 0.17 / 0.29  # a riser over a tread, of public buildings
_STAIRS_PACE = 0.4  # of the speed on the level, as seen from above: Fruin 1971, 0.51 m/s upwards
_SHARE_ON_STAIRS = 0.3  # of the scene's places: on the flight or beyond it


def ramp(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks over ground that rises by `size` metres a metre beyond a line through the site.

    The line passes the middle of the scene's places in a drawn direction: half of the people are on
    the ramp. It falls where `size` is below 0.
    """
    uphill, along = _uphill(view, seed)
    begins = float(np.median(along))
    found = []
    for track in tracks:
        ground, _ = ground_of(track, view)
        found.append(_raised(track, view, size * np.maximum(ground @ uphill - begins, 0.0)))
    return [track for track in found if track is not None]


def stairs(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks over a flight of stairs that is `size` metres high, and the floor that it leads to.

    It begins beyond a line, in a drawn direction, that three tenths of the scene's places lie
    beyond. On it people are slower, as seen from above; in the middle of a step they are as high as
    on a ramp of the same grade.
    """
    uphill, along = _uphill(view, seed)
    begins = float(np.quantile(along, 1 - _SHARE_ON_STAIRS))
    found = []
    for track in tracks:
        ground, _ = ground_of(track, view)
        rise = np.clip((ground @ uphill - begins) * _STAIRS_GRADE, 0.0, size)
        on_flight = (rise > 0) & (rise < size)
        own = track.trajectory.time_s
        between = np.diff(own) * np.where(on_flight[1:] | on_flight[:-1], 1 / _STAIRS_PACE, 1.0)
        time_s = own[0] + np.concatenate([[0.0], np.cumsum(between)])
        found.append(_raised(track, view, rise, time_s))
    return [track for track in found if track is not None]


def _uphill(view: View, seed: int) -> tuple[Array, Array]:
    """A drawn direction (2,), and how far along it the scene's places are (N,)."""
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    uphill = np.array([np.cos(angle), np.sin(angle)])
    return uphill, view.places @ uphill


def _raised(
    track: SceneTrack, view: View, rise_m: Array, time_s: Array | None = None
) -> SceneTrack | None:
    """The track on ground that is so much higher (N,) than the plane; None if hardly in view."""
    own, pose, lens = track.trajectory, view.pose, view.intrinsics
    ground, _ = ground_of(track, view)
    points = np.concatenate([ground, rise_m[:, None]], axis=1) - pose.centre_m
    uv, _ = lens.project(points @ pose.rotation.T)
    top_v = None
    if own.top_v is not None:
        tall, _ = statures(lens, pose.rotation, pose.height_m, own.uv, own.top_v)
        heads, _ = lens.project(
            (points + np.stack([0 * tall, 0 * tall, tall], 1)) @ pose.rotation.T
        )
        top_v = heads[:, 1]
    return seen_again(track, view, uv, top_v, time_s)


def wrong_k1(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks by a lens whose k1 is larger by `size` than the configured one. Nothing is drawn."""
    lens = view.intrinsics
    k1, k2, p1, p2, k3 = lens.distortion
    return _through(tracks, view, replace(lens, distortion=(k1 + size, k2, p1, p2, k3)))


def wrong_focal_length(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks by a lens that is longer by a share `size` than configured. Nothing is drawn."""
    lens = view.intrinsics
    return _through(tracks, view, replace(lens, fx=lens.fx * (1 + size), fy=lens.fy * (1 + size)))


def wrong_principal_point(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks by a lens whose axis is `size` of the picture's width beside the configured one.

    In a drawn direction.
    """
    lens = view.intrinsics
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    by = size * lens.width
    real = replace(lens, cx=lens.cx + by * np.cos(angle), cy=lens.cy + by * np.sin(angle))
    return _through(tracks, view, real)


def _through(tracks: Sequence[SceneTrack], view: View, real: Intrinsics) -> list[SceneTrack]:
    """Tracks as the real lens images the rays that the configured one has computed."""
    found = []
    for track in tracks:
        own = track.trajectory
        rays, _ = view.intrinsics.rays(own.uv)
        uv, _ = real.project(rays)
        top_v = None
        if own.top_v is not None:
            top_rays, _ = view.intrinsics.rays(np.stack([own.uv[:, 0], own.top_v], axis=1))
            top_v = real.project(top_rays)[0][:, 1]
        found.append(seen_again(track, view, uv, top_v))
    return [track for track in found if track is not None]
