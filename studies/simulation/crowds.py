"""Random sites and the people who walk there: lanes, ways and pace."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.simulation.poses import PoseSet
from models.simulation.walkers import WalkConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowConfig:
    """Ranges of the differences between sites; every one is drawn from once for each site.

    The site's mean speed is the assumed one times exp N(0, `site_speed_log_sd`); its speed also
    changes with place, by N(0, `speed_slope_log_sd_per_m`) along x and along y. A lane runs
    parallel to the site's first with chance `parallel_share`. A walker follows one of the lanes,
    on `gathered_share` of the sites only within some metres of one place on it; some, at most
    `most_free` of them and mostly few, none. On `bounded_share` of the sites people keep to the
    ground that the first view shows. How busy a lane is changes by `busy_log_sd` from view to view.
    `slow_share` dawdle. `noise_px` is at a width of 1920 pixels, correlated from point to point.
    """

    lanes: tuple[int, int] = (1, 3)
    lane_spread_m: tuple[float, float] = (0.3, 2.5)
    lane_angle_sd_rad: float = math.radians(6)
    parallel_share: float = 0.5
    most_free: float = 0.5
    gathered_share: float = 0.5
    gathered_m: tuple[float, float] = (2.0, 20.0)
    bounded_share: float = 0.5
    busy_log_sd: float = 0.4
    site_speed_log_sd: float = 0.12
    speed_slope_log_sd_per_m: float = 0.003
    person_speed_log_sd: tuple[float, float] = (0.08, 0.35)
    within_speed_log_sd: tuple[float, float] = (0.0, 0.15)
    slow_share: tuple[float, float] = (0.0, 0.15)
    turn_sd_rad_per_s: tuple[float, float] = (math.radians(1), math.radians(6))
    noise_px: tuple[float, float] = (1.0, 10.0)
    noise_correlation: tuple[float, float] = (0.0, 0.9)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSites:
    """Sites (S,) as they stay: their lanes (S, L), ways and pace."""

    lanes: npt.NDArray[np.int64]
    lane_point_m: Array  # (S, L, 2)
    lane_direction: Array
    lane_backward: Array
    lane_weight: Array
    lane_spread_m: Array
    gathered_m: Array  # NaN where people come anywhere along a lane
    free_share: Array
    slow_share: Array
    bounds: PoseSet  # the first view; people of a bounded site keep to what it shows
    bounded: npt.NDArray[np.bool_]
    log_pace: Array
    slope_per_m: Array  # (S, 2)
    person_log_sd: Array
    within_log_sd: Array
    turn_sd: Array
    noise_px: Array
    noise_rho: Array


def draw_simulated_sites(
    intrinsics: Intrinsics,
    poses: PoseSet,
    flow: FlowConfig,
    walk: WalkConfig,
    rng: np.random.Generator,
) -> SimulatedSites:
    """Sites, one for each pose."""
    sites, most = len(poses), flow.lanes[1]

    def even(low_high: tuple[float, float]) -> Array:
        return np.asarray(rng.uniform(*low_high, sites))

    def even_log(low_high: tuple[float, float]) -> Array:
        return np.exp(rng.uniform(math.log(low_high[0]), math.log(low_high[1]), sites))

    direction = rng.uniform(0, 2 * math.pi, (sites, most))
    parallel = rng.random((sites, most)) < flow.parallel_share
    gathered = rng.random(sites) < flow.gathered_share
    return SimulatedSites(
        lanes=rng.integers(flow.lanes[0], most + 1, sites),
        lane_point_m=_ground_points(intrinsics, poses, most, walk.farthest_m, rng),
        lane_direction=np.where(parallel, direction[:, :1], direction),
        lane_backward=rng.uniform(0, 1, (sites, most)),
        lane_weight=rng.exponential(1.0, (sites, most)),
        lane_spread_m=even_log(flow.lane_spread_m),
        gathered_m=np.where(gathered, even_log(flow.gathered_m), np.nan),
        free_share=flow.most_free * even((0.0, 1.0)) ** 2,
        slow_share=even(flow.slow_share),
        bounds=poses,
        bounded=rng.random(sites) < flow.bounded_share,
        log_pace=math.log(walk.speed_mean_mps) + rng.normal(0, flow.site_speed_log_sd, sites),
        slope_per_m=rng.normal(0, flow.speed_slope_log_sd_per_m, (sites, 2)),
        person_log_sd=even(flow.person_speed_log_sd),
        within_log_sd=even(flow.within_speed_log_sd),
        turn_sd=even(flow.turn_sd_rad_per_s),
        noise_px=even_log(flow.noise_px),
        noise_rho=even(flow.noise_correlation),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """The walkers of one visit to all sites (W,): their ways and their pace."""

    site_idx: npt.NDArray[np.int64]
    lane_point_m: Array  # (W, 2)
    lane_direction: Array
    aside_m: Array
    along_m: Array  # NaN where people come anywhere along the lane
    free: npt.NDArray[np.bool_]
    direction: Array
    turn: Array
    log_pace: Array  # (W, T - 1)
    slope_per_m: Array  # (W, 2)
    noise_px: Array
    noise_rho: Array


def draw_crowd(
    sites: SimulatedSites, people: int, flow: FlowConfig, walk: WalkConfig, rng: np.random.Generator
) -> Crowd:
    """Other people on every visit; the lanes are the site's, how busy they are changes somewhat."""
    most = flow.lanes[1]
    site = np.repeat(np.arange(sites.lanes.size, dtype=np.int64), people)
    count = site.size
    busy = sites.lane_weight * np.exp(rng.normal(0, flow.busy_log_sd, sites.lane_weight.shape))
    busy = np.where(np.arange(most) < sites.lanes[:, None], busy, 0.0)
    upto = np.cumsum(busy, axis=1) / busy.sum(1, keepdims=True)
    lane = np.minimum((rng.random(count)[:, None] > upto[site]).sum(1), most - 1)
    free = rng.random(count) < sites.free_share[site]
    direction = sites.lane_direction[site, lane] + rng.normal(0, flow.lane_angle_sd_rad, count)
    direction += math.pi * (rng.random(count) < sites.lane_backward[site, lane])
    slow = rng.random(count) < sites.slow_share[site]
    person = rng.normal(0, 1, count) * sites.person_log_sd[site]
    person += np.where(slow, np.log(rng.uniform(0.05, 0.8, count)), 0.0)
    within = correlated(rng, 0.8, (count, walk.max_points - 1))
    return Crowd(
        site_idx=site,
        lane_point_m=sites.lane_point_m[site, lane],
        lane_direction=sites.lane_direction[site, lane],
        aside_m=rng.normal(0, 1, count) * sites.lane_spread_m[site],
        along_m=rng.normal(0, 1, count) * sites.gathered_m[site],
        free=free,
        direction=np.where(free, rng.uniform(0, 2 * math.pi, count), direction),
        turn=rng.normal(0, 1, count) * sites.turn_sd[site],
        log_pace=(sites.log_pace[site] + person)[:, None]
        + sites.within_log_sd[site, None] * within,
        slope_per_m=sites.slope_per_m[site],
        noise_px=sites.noise_px[site],
        noise_rho=sites.noise_rho[site],
    )


def _ground_points(
    intrinsics: Intrinsics, poses: PoseSet, count: int, farthest_m: float, rng: np.random.Generator
) -> Array:
    """Points (P, count, 2) on the ground, even over the picture; NaN where it shows too little."""
    points = np.full((len(poses), count, 2), np.nan)
    for _ in range(8):
        pixels = any_pixel(intrinsics, (len(poses), count), rng)
        drawn, hits = ground_from_pixel(intrinsics, poses.rotation, poses.centre_m, pixels)
        near = np.linalg.norm(drawn - poses.centre_m[:, None, :2], axis=-1) < farthest_m
        fresh = hits & near & np.isnan(points[..., 0])
        points[fresh] = drawn[fresh]
    return points


def any_pixel(intrinsics: Intrinsics, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Pixels (..., 2), even over the picture."""
    high = (intrinsics.width - 0.5, intrinsics.height - 0.5)
    return np.asarray(rng.uniform((-0.5, -0.5), high, (*shape, 2)))


def unit_heading(angle_rad: Array) -> Array:
    """Unit vectors (..., 2) on the ground of angles clockwise from +Y."""
    return np.stack([np.sin(angle_rad), np.cos(angle_rad)], axis=-1)


def correlated(rng: np.random.Generator, rho: Array | float, shape: tuple[int, ...]) -> Array:
    """Normal noise of a shape (W, T, ...) whose neighbours along T correlate by `rho`."""
    noise = rng.normal(0, 1, shape)
    kept = np.broadcast_to(rho, shape[0]).reshape(-1, *([1] * (len(shape) - 2)))
    fresh = np.sqrt(1 - kept**2)
    for step in range(1, shape[1]):
        noise[:, step] = kept * noise[:, step - 1] + fresh * noise[:, step]
    return noise
