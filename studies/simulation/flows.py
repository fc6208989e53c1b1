"""Sites: many people seen from one pose, who follow the lanes and the pace of their place."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel, pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.simulation.poses import PoseSet
from models.simulation.walkers import WalkConfig, Walks
from studies.simulation.crowds import (
    Crowd,
    FlowConfig,
    SimulatedSites,
    any_pixel,
    correlated,
    draw_crowd,
    draw_simulated_sites,
    unit_heading,
)

_ROUNDS = 40
_SHORTER_AFTER = 8  # rounds after which a walk that never fits is asked for with fewer points
_FREE_AFTER = 15  # rounds after which a walker whose lane never fits walks anywhere
_REFERENCE_WIDTH_PX = 1920.0  # the width at which `FlowConfig`'s pixel noise is given


def simulate_sites(
    intrinsics: Intrinsics,
    views: Sequence[PoseSet],
    people: int,
    flow: FlowConfig,
    walk: WalkConfig,
    rng: np.random.Generator,
) -> list[Walks]:
    """Noisy walks of some people for each pose of each view; `pose_idx` names the site.

    Place i of every view is the same site: the same lanes and pace, other people. Walks of one
    site stand together. A site that sees too little ground has fewer walks, or none.

    Raises:
        DegenerateGeometryError: a view in which no site sees enough ground for a walk.
    """
    sites = draw_simulated_sites(intrinsics, views[0], flow, walk, rng)
    return [_visit(intrinsics, poses, sites, people, flow, walk, rng) for poses in views]


def _visit(
    intrinsics: Intrinsics,
    poses: PoseSet,
    sites: "SimulatedSites",
    people: int,
    flow: FlowConfig,
    walk: WalkConfig,
    rng: np.random.Generator,
) -> Walks:
    crowd = draw_crowd(sites, people, flow, walk, rng)
    count = crowd.site_idx.size
    wanted = rng.integers(walk.min_points, walk.max_points + 1, count)
    uv = np.full((count, walk.max_points, 2), np.nan)
    lengths = np.zeros(count, dtype=np.int64)
    open_idx = np.arange(count, dtype=np.int64)
    for round_no in range(_ROUNDS):
        if round_no >= _SHORTER_AFTER:
            wanted[open_idx] = rng.integers(walk.min_points, wanted[open_idx] + 1)
        on_lane = round_no < _FREE_AFTER
        rows, path, seen = _try_walks(
            intrinsics, poses, crowd, open_idx, wanted[open_idx], walk, on_lane, rng
        )
        stays = _stays(intrinsics, sites, crowd.site_idx[rows], path)
        rows, seen = rows[stays], seen[stays]
        uv[rows], lengths[rows] = seen, wanted[rows]
        open_idx = np.setdiff1d(open_idx, rows, assume_unique=True)
        if not open_idx.size:
            break
    made = np.flatnonzero(lengths)
    if not made.size:
        raise DegenerateGeometryError(
            f"poses: none of {len(poses)} sees ground within {walk.farthest_m:g} m for a walk of "
            f"{walk.min_points} points"
        )
    noise = correlated(rng, crowd.noise_rho, uv.shape)
    uv += noise * crowd.noise_px[:, None, None] * intrinsics.width / _REFERENCE_WIDTH_PX
    return Walks(uv=uv[made], lengths=lengths[made], pose_idx=crowd.site_idx[made])


def _try_walks(
    intrinsics: Intrinsics,
    poses: PoseSet,
    crowd: Crowd,
    rows: npt.NDArray[np.int64],
    wanted: npt.NDArray[np.int64],
    walk: WalkConfig,
    on_lane: bool,
    rng: np.random.Generator,
) -> tuple[npt.NDArray[np.int64], Array, Array]:
    """The rows whose new draw lies inside the image, where it goes (B, T, 2), and its pixels.

    Both are NaN after the wanted points.
    """
    seen_by = poses.take(crowd.site_idx[rows])
    rotation, centre = seen_by.rotation, seen_by.centre_m
    pixel = any_pixel(intrinsics, (rows.size, 1), rng)
    anchor, hits = ground_from_pixel(intrinsics, rotation, centre, pixel)
    anchor, point = anchor[:, 0], crowd.lane_point_m[rows]
    along = unit_heading(crowd.lane_direction[rows])
    beside = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    on_path = ((anchor - point) * along).sum(-1, keepdims=True)
    on_path = np.where(np.isnan(crowd.along_m[rows, None]), on_path, crowd.along_m[rows, None])
    snapped = point + on_path * along + crowd.aside_m[rows, None] * beside
    follows = ~crowd.free[rows] & np.isfinite(point[:, 0]) & on_lane
    anchor = np.where(follows[:, None], snapped, anchor)
    offset = anchor - centre[:, :2]
    keep = hits[:, 0] & (np.hypot(offset[:, 0], offset[:, 1]) < walk.farthest_m)

    anchor_idx = (rng.random(rows.size) * wanted).astype(np.int64)
    steps = np.arange(walk.max_points)
    heading = crowd.direction[rows, None] + crowd.turn[rows, None] * walk.step_s * (
        steps[:-1] - anchor_idx[:, None]
    )
    faster = (crowd.slope_per_m[rows] * offset).sum(-1)
    stride = walk.step_s * np.exp(crowd.log_pace[rows] + np.clip(faster, -0.3, 0.3)[:, None])
    path = np.pad(
        np.cumsum(stride[..., None] * unit_heading(heading), axis=1), ((0, 0), (1, 0), (0, 0))
    )
    path += (anchor - np.take_along_axis(path, anchor_idx[:, None, None], axis=1)[:, 0])[:, None]

    # The two ends alone rule out most candidates; only the rest are projected whole.
    last = np.take_along_axis(path, wanted[:, None, None] - 1, axis=1)
    ends = np.concatenate([path[:, :1], last], axis=1)
    ends_uv, _ = pixel_from_ground(intrinsics, rotation, centre, ends)
    keep &= intrinsics.contains(ends_uv).all(-1)
    path, wanted, rows = path[keep], wanted[keep], rows[keep]
    seen, _ = pixel_from_ground(intrinsics, rotation[keep], centre[keep], path)
    walked = steps < wanted[:, None]
    far = np.linalg.norm(path - centre[keep, None, :2], axis=-1) >= walk.farthest_m
    fits = ((intrinsics.contains(seen) & ~far) | ~walked).all(-1)
    there = walked[fits][..., None]
    return rows[fits], np.where(there, path[fits], np.nan), np.where(there, seen[fits], np.nan)


def _stays(
    intrinsics: Intrinsics, sites: SimulatedSites, site_idx: npt.NDArray[np.int64], path: Array
) -> npt.NDArray[np.bool_]:
    """Mask of paths (B, T, 2), NaN at their ends, that keep to the ground of their site."""
    stays = ~sites.bounded[site_idx]
    rows = np.flatnonzero(~stays)
    view = sites.bounds.take(site_idx[rows])
    uv, _ = pixel_from_ground(intrinsics, view.rotation, view.centre_m, path[rows])
    stays[rows] = (intrinsics.contains(uv) | np.isnan(path[rows, :, 0])).all(-1)
    return stays
