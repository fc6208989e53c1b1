"""A ground that is no plane, and a lens that is not the one that was configured."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.evaluation.injectors.view import View, ground_of, seen_again
from models.evaluation.scenes import SceneTrack
from models.geometry.intrinsics import Intrinsics
from models.geometry.upright import statures


def ramp(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks over ground that rises by `size` metres a metre beyond a line through the site.

    The line passes the middle of the scene's places in a drawn direction: half of the people are on
    the ramp. It falls where `size` is below 0.
    """
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    uphill = np.array([np.cos(angle), np.sin(angle)])
    begins = float(np.median(view.places @ uphill))
    pose, lens = view.pose, view.intrinsics
    found = []
    for track in tracks:
        own = track.trajectory
        ground, _ = ground_of(track, view)
        rise = size * np.maximum(ground @ uphill - begins, 0.0)
        points = np.concatenate([ground, rise[:, None]], axis=1) - pose.centre_m
        uv, _ = lens.project(points @ pose.rotation.T)
        top_v = None
        if own.top_v is not None:
            tall, _ = statures(lens, pose.rotation, pose.height_m, own.uv, own.top_v)
            heads, _ = lens.project(
                (points + np.stack([0 * tall, 0 * tall, tall], 1)) @ pose.rotation.T
            )
            top_v = heads[:, 1]
        found.append(seen_again(track, view, uv, top_v))
    return [track for track in found if track is not None]


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
    """What the real lens makes of the rays that the configured one has told."""
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
