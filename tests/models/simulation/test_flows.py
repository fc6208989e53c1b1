from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import DegenerateGeometryError
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseSet, repeated_pose
from models.simulation.walkers import WalkConfig, Walks
from studies.simulation.crowds import FlowConfig
from studies.simulation.flows import simulate_sites

# One lane, no strays, steady people, no noise.
ORDERLY = FlowConfig(
    lanes=(1, 1), lane_spread_m=(0.01, 0.02), lane_angle_sd_rad=0.0, most_free=0.0,
    gathered_share=0.0, site_speed_log_sd=0.0, speed_slope_log_sd_per_m=0.0,
    person_speed_log_sd=(0.0, 0.0), within_speed_log_sd=(0.0, 0.0), slow_share=(0.0, 0.0),
    turn_sd_rad_per_s=(0.0, 0.0), noise_px=(1e-9, 2e-9),
)  # fmt: skip


def visit(
    lens: Intrinsics, views: list[PoseSet], flow: FlowConfig, people: int = 30, seed: int = 0
) -> list[Walks]:
    return simulate_sites(lens, views, people, flow, WalkConfig(), np.random.default_rng(seed))


def paths(lens: Intrinsics, poses: PoseSet, walks: Walks) -> np.ndarray:
    seen_by = poses.take(walks.pose_idx)
    return ground_from_pixel(lens, seen_by.rotation, seen_by.centre_m, walks.uv)[0]


def courses(ground: np.ndarray) -> np.ndarray:
    """Directions (B,) of walks as axes: a half turn apart is the same."""
    step = ground[:, 1] - ground[:, 0]
    return np.arctan2(step[:, 0], step[:, 1]) % np.pi


def test_people_of_a_site_share_a_lane_and_sites_differ(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 12)
    (walks,) = visit(lens, [poses], ORDERLY)
    axis = courses(paths(lens, poses, walks))
    of_site = []
    for site in range(12):
        doubled = np.exp(2j * axis[walks.pose_idx == site])
        of_site.append(np.angle(np.median(doubled.real) + 1j * np.median(doubled.imag)))
        # Those whose lane leaves the picture too soon walk anywhere; most keep to it.
        assert (np.abs(doubled - np.exp(1j * of_site[-1])) < 1e-3).mean() > 0.5
    assert np.std(of_site) > 0.5


def test_a_second_look_finds_the_same_lanes_and_other_people(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 8)
    moved = replace(poses, tilt_rad=poses.tilt_rad + radians(5))
    first, second = visit(lens, [poses, moved], ORDERLY)
    for site in range(8):
        here, there = (
            np.exp(2j * courses(paths(lens, seen_by, walks)[walks.pose_idx == site]))
            for seen_by, walks in ((poses, first), (moved, second))
        )
        middle = np.median(here.real) + 1j * np.median(here.imag)
        assert abs(np.median(there.real) + 1j * np.median(there.imag) - middle) < 0.05
    assert not np.array_equal(first.uv[:20], second.uv[:20], equal_nan=True)


def test_orderly_people_keep_the_assumed_speed(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 5)
    (walks,) = visit(lens, [poses], ORDERLY)
    strides = np.linalg.norm(np.diff(paths(lens, poses, walks), axis=1), axis=-1)
    assert_allclose(strides[np.isfinite(strides)], 1.4 * 0.4, rtol=1e-5)


def test_sites_differ_in_speed_by_what_was_asked(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 300)
    (walks,) = visit(lens, [poses], replace(ORDERLY, site_speed_log_sd=0.2), people=3)
    strides = np.linalg.norm(np.diff(paths(lens, poses, walks), axis=1), axis=-1)
    log_speed = np.log(np.nanmean(strides, axis=1) / (1.4 * 0.4))
    sites = np.array([log_speed[walks.pose_idx == site].mean() for site in range(300)])
    assert sites.std() == pytest.approx(0.2, rel=0.12)
    assert max(np.ptp(log_speed[walks.pose_idx == site]) for site in range(300)) < 1e-6


def test_walks_lie_inside_the_image_and_are_nan_after_their_length(
    lens: Intrinsics, pose: CameraPose
):
    (walks,) = visit(lens, [repeated_pose(pose, 20)], replace(ORDERLY, most_free=1.0))
    there = np.arange(31) < walks.lengths[:, None]
    assert_array_equal(np.isfinite(walks.uv[..., 0]), there)
    assert lens.contains(walks.uv[there], 1e-6).all()
    assert (np.diff(walks.pose_idx) >= 0).all()
    assert walks.lengths.min() >= 11


def test_noise_has_the_asked_size_and_correlation(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 40)
    loud = replace(ORDERLY, noise_px=(3.0, 3.0001), noise_correlation=(0.8, 0.8001))
    (clean,), (noisy,) = (visit(lens, [poses], flow) for flow in (
        replace(loud, noise_px=(1e-9, 1.0001e-9)), loud))  # fmt: skip
    noise = noisy.uv - clean.uv
    assert np.nanstd(noise) == pytest.approx(3.0 * lens.width / 1920, rel=0.05)
    a, b = noise[:, :10].ravel(), noise[:, 1:11].ravel()
    assert np.corrcoef(a, b)[0, 1] == pytest.approx(0.8, abs=0.03)


def test_the_seed_alone_makes_the_site(lens: Intrinsics, pose: CameraPose):
    poses = repeated_pose(pose, 4)
    first, again, other = (
        visit(lens, [poses], FlowConfig(), seed=seed)[0].uv for seed in (1, 1, 2)
    )
    assert_array_equal(first, again)
    assert first.shape != other.shape or not np.array_equal(first, other, equal_nan=True)


def test_a_camera_that_sees_only_sky_has_no_site(lens: Intrinsics):
    sky = repeated_pose(CameraPose(height_m=6, tilt_rad=radians(-60)), 3)
    with pytest.raises(DegenerateGeometryError, match="none of 3"):
        visit(lens, [sky], FlowConfig())
