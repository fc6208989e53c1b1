"""Upright people: how tall a vertical pole on the ground is, from its foot and its top edge."""

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask


def stature_ratio(rotation: Array, foot_rays: Array, top_y: Array) -> tuple[Array, Array]:
    """Heights (N,) of poles as shares of the camera's height, and ground points (N, 2) likewise.

    `foot_rays` (N, 3), z = 1, are of the camera frame, below the horizon; `top_y` (N,) is the
    undistorted, normalised y / z of the top edge there.

    Only the top edge's y is used: the box of a person in a rolled picture is wider than they are,
    and its middle is not their head. The pole's top (p, s - 1), camera at the origin and of height
    1, has y / z = (down . top) / (forward . top), which is linear in s.
    """
    world = foot_rays @ rotation
    on_ground = world / -world[..., 2:3]  # (p, -1)
    _, down, forward = rotation
    lever = down[2] - top_y * forward[2]
    ratio = (top_y * (on_ground @ forward) - on_ground @ down) / lever
    return ratio, on_ground[..., :2]


def statures(
    intrinsics: Intrinsics, rotation: Array, height_m: float, uv: Array, top_v: Array
) -> tuple[Array, Mask]:
    """Heights in metres (N,) of upright people with feet (N, 2) and top edges (N,) in pixels.

    Not valid (N,) and NaN where a foot is above the horizon or the top edge is not known.
    """
    feet, on_ray = intrinsics.rays(uv)
    tops, top_on_ray = intrinsics.rays(np.stack([uv[:, 0], top_v], axis=-1))
    valid = on_ray & top_on_ray & ((feet @ rotation)[:, 2] < 0)
    ratio, _ = stature_ratio(
        rotation, np.where(valid[:, None], feet, (0.0, 1e6, 1.0)), np.where(valid, tops[:, 1], 0.0)
    )
    tall = np.where(valid, ratio * height_m, np.nan)
    valid = valid & (np.nan_to_num(tall) > 0)
    return np.where(valid, tall, np.nan), valid


def tops_seen(
    intrinsics: Intrinsics, rotation: Array, centre_m: Array, ground_m: Array, tall_m: Array
) -> Array:
    """The v (N,) in pixels of the tops of poles at ground points (N, 2), NaN where not in view."""
    tops = np.concatenate([ground_m, tall_m[:, None]], axis=-1) - centre_m
    uv, valid = intrinsics.project(tops @ rotation.T)
    inside = valid & (uv[:, 1] > 1) & (uv[:, 1] < intrinsics.height - 2)
    return np.where(inside, uv[:, 1], np.nan)


def heads_seen(intrinsics: Intrinsics, pose: CameraPose, heads_m: Array) -> Array:
    """Pixels (N, 2) of heads (N, 3) in the world, in metres; NaN where not in view."""
    uv, valid = intrinsics.project((heads_m - pose.centre_m) @ pose.rotation.T)
    return np.where((valid & uncut(intrinsics, uv))[:, None], uv, np.nan)


def heads_above(intrinsics: Intrinsics, pose: CameraPose, ground_m: Array, head_uv: Array) -> Array:
    """World points (N, 3) of heads with pixels (N, 2), each as far away as its foot (N, 2) is.

    That is where a head's ray meets the upright plane through the foot that faces the camera: how
    far it leans to the side is kept, what it leans along the view is taken for stature. NaN where
    the pixel is, or where the ray never comes so far.
    """
    rays, valid = intrinsics.rays(head_uv)
    rays = rays @ pose.rotation
    away = ground_m - pose.centre_m[:2]
    along = (rays[:, :2] * away).sum(axis=1)
    valid = valid & (along > 0)
    share = (away**2).sum(axis=1) / np.where(valid, along, np.nan)
    return np.asarray(pose.centre_m + rays * share[:, None])


def uncut(intrinsics: Intrinsics, uv: Array) -> Mask:
    """Mask of pixels (N, 2) inside the image, and not at its border, where what is cut ends."""
    u, v = uv.T
    return np.asarray((u > 1) & (v > 1) & (u < intrinsics.width - 2) & (v < intrinsics.height - 2))


def tops_of_boxes(intrinsics: Intrinsics, boxes: Array) -> Array:
    """The upper edges (N,) of boxes x1, y1, x2, y2 (N, 4); NaN where the image border cuts them."""
    x1, y1, x2, y2 = boxes.T
    whole = (x1 > 1) & (y1 > 1) & (x2 < intrinsics.width - 2) & (y2 < intrinsics.height - 2)
    return np.where(whole & (y2 > y1), y1, np.nan)
