"""The flow map: geometry with its derivatives, a density that is one, registration with pan."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.ground import rotation_and_turns
from models.geometry.pose import array_of
from models.paths.config import DIRECTIONS
from models.paths.ground_steps import place_steps, slope_of, step_on_ground
from models.paths.likelihood import walkers_of
from models.paths.reference import learn_paths
from models.pose.fusion import fused_estimate
from models.pose.site import CameraSite
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Steps
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from studies.simulation.lanes import SiteConfig
from tests.models.sites import KNOCKED, LENS, PRIOR, seen, tracks_of

TURNED = replace(KNOCKED, heading_rad=math.radians(7))
SITE = SiteConfig(aside_m=0.8, standing_share=0.0)


@pytest.fixture(scope="module")
def site():
    known, after, still = tracks_of(3, (PRIOR, 200), (TURNED, 100), (PRIOR, 100), config=SITE)
    reference = learn_paths(seen(known), LENS, PRIOR, 0)
    speeds = learn_speed_reference(seen(known), PRIOR, WalkConfig(), 0)
    assert reference is not None
    return reference, speeds, seen(after), seen(still), seen(known)


def step_between(start: np.ndarray, end: np.ndarray) -> Steps:
    """One step from ray to ray (x, y)."""
    rays = [np.array([[*ray, 1.0]]) for ray in (start, end)]
    some = seen(tracks_of(3, (PRIOR, 1))[0]).steps
    return replace(
        some, start_rays=rays[0], end_rays=rays[1], noisy_end_rays=rays[1], seconds=np.ones(1)
    )


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_derivatives_are_those_of_differences(site, number):
    at = array_of(TURNED)
    step = 1e-6 * np.eye(4)[number]
    steps = site[2].steps
    rotation, turns = rotation_and_turns(at[0], at[1], at[3])
    said = [
        slope_of(step_on_ground(steps.start_rays, steps.end_rays, one, rotation), turns, number)
        for one in range(len(steps.seconds))
    ]
    after, before = (place_steps(steps, at + sign * step) for sign in (1, -1))
    place = (after.place - before.place) / 2e-6
    d_place = math.exp(at[2]) * np.array([(slope.x, slope.y) for slope in said])
    assert_allclose(d_place, place, atol=1e-2 * max(np.abs(place).max(), 1))
    turned = np.angle(np.exp(1j * (after.direction - before.direction))) / 2e-6
    assert_allclose([slope.direction for slope in said], turned, atol=1e-4)
    ratio = (after.log_ratio - before.log_ratio) / 2e-6
    d_log_ratio = [slope.log_ratio for slope in said]
    assert_allclose(d_log_ratio, ratio, atol=1e-2 * max(np.abs(ratio).max(), 1))


def test_the_change_of_measure_is_the_jacobian_written_out():
    at = array_of(TURNED)

    def on_ground(x: float, y: float, angle: float) -> np.ndarray:
        half = 1e-4 * np.array([math.cos(angle), math.sin(angle)])
        placed = place_steps(step_between([x, y] - half, [x, y] + half), at)
        return np.array([*placed.place[0], placed.direction[0]])

    here = np.array([0.1, 0.15, 0.7])
    columns = [
        (on_ground(*(here + step)) - on_ground(*(here - step))) / 2e-5
        for step in 1e-5 * np.eye(3)
    ]  # fmt: skip
    half = 1e-4 * np.array([math.cos(0.7), math.sin(0.7)])
    said = place_steps(step_between(here[:2] - half, here[:2] + half), at).log_ratio[0]
    assert said == pytest.approx(math.log(abs(np.linalg.det(np.array(columns)))), abs=1e-3)


def test_the_density_is_one_in_all_and_high_where_people_walk(site):
    flow, known = site[0].density, site[4]
    node = flow.cell_m**2 * 2 * math.pi / DIRECTIONS
    assert np.exp(flow.log_density).sum() * node == pytest.approx(1, abs=1e-3)
    walkers = walkers_of(known, array_of(PRIOR))
    placed = place_steps(walkers.steps, array_of(PRIOR))
    all_day = np.zeros(len(placed.place), dtype=np.int64)
    along, _, _ = flow.log_density_at(placed.place, placed.direction, all_day)
    across, _, _ = flow.log_density_at(placed.place, placed.direction + math.pi / 2, all_day)
    assert np.mean(along) > np.mean(across) + 1
    assert np.mean(along) > flow.elsewhere + 4


def test_slopes_of_the_map_are_those_of_differences(site):
    rng = np.random.default_rng(0)
    flow = site[0].density
    place = flow.corner + rng.uniform(5, 30, (40, 2))
    direction = rng.uniform(-math.pi, math.pi, 40)
    all_day = np.zeros(40, dtype=np.int64)

    def value(place: np.ndarray, direction: np.ndarray) -> np.ndarray:
        return flow.log_density_at(place, direction, all_day)[0]

    _, by_place, by_direction = flow.log_density_at(place, direction, all_day)
    unseen, unseen_by_place = flow.unseen_at(place)
    assert unseen.min() < 0.1 < 0.9 < unseen.max()
    for axis in (0, 1):
        step = 1e-7 * np.eye(2)[axis]
        found = (value(place + step, direction) - value(place - step, direction)) / 2e-7
        assert_allclose(by_place[:, axis], found, atol=1e-4)
        found = flow.unseen_at(place + step)[0] - flow.unseen_at(place - step)[0]
        assert_allclose(unseen_by_place[:, axis], found / 2e-7, atol=1e-4)
    turned = value(place, direction + 1e-7) - value(place, direction - 1e-7)
    assert_allclose(by_direction, turned / 2e-7, atol=1e-4)


def test_off_the_grid_is_elsewhere(site):
    flow = site[0].density
    at = flow.corner[None] - 1.0
    value, by_place, by_direction = flow.log_density_at(
        at, np.zeros(1), np.zeros(1, dtype=np.int64)
    )
    assert_allclose(value, flow.elsewhere)
    assert not by_place.any()
    assert not by_direction.any()


def test_a_camera_sees_what_is_before_it(site):
    coverage = site[0].coverage
    assert coverage.shares.sum() == pytest.approx(1, abs=1e-3)
    at = array_of(PRIOR)
    known, unknown = coverage.seen_from(LENS, at)
    assert known > 0.8
    assert unknown < 0.1
    known, unknown = coverage.seen_from(LENS, at + [0, 0, 0, math.radians(30)])
    assert known < 0.5
    assert unknown > 0.15
    assert coverage.seen_from(LENS, at + [0, 0, 0, math.pi])[0] < 0.02


def test_scores_are_derivatives_of_the_likelihood(site):
    reference, _, after, _, _ = site
    at = array_of(TURNED)
    walkers = walkers_of(after, at)

    def value(candidate: np.ndarray) -> float:
        return reference.model(LENS).likelihood(walkers, candidate).value

    said = reference.model(LENS).likelihood(walkers, at).scores.sum(axis=0)
    for number, step in enumerate(1e-3 * np.eye(4)):
        slope = (value(at + step) - value(at - step)) / 2e-3
        assert said[number] == pytest.approx(slope, rel=0.1, abs=0.1 * np.abs(said).max())


def test_a_turned_camera_is_told_with_its_heading(site):
    reference, speeds, after, still, _ = site
    for tracks, pose in ((after, TURNED), (still, PRIOR)):
        joint = joint_estimate(tracks, PRIOR, speeds)
        fused = fused_estimate(
            tracks,
            CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=speeds, paths=reference),
            joint,
        )
        assert fused.registered
        assert fused.identifiable == ("tilt", "roll", "height", "heading")
        off = fused.values - array_of(pose)
        assert np.abs(np.degrees(off[[0, 1, 3]])).max() < 1.0
        assert np.abs(off / np.sqrt(np.diag(fused.covariance))).max() < 3.5
        assert math.sqrt(fused.covariance[3, 3]) < math.radians(1.0)


def test_few_people_make_no_map_and_no_registration(site):
    reference, speeds, _, _, _ = site
    (few,) = tracks_of(3, (PRIOR, 8))
    assert learn_paths(seen(few), LENS, PRIOR, 0) is None
    joint = joint_estimate(seen(few[:3]), PRIOR, speeds)
    fused = fused_estimate(
        seen(few[:3]),
        CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=speeds, paths=reference),
        joint,
    )
    assert not fused.registered
    assert "heading" not in fused.identifiable
    assert_allclose(fused.values, [*joint.values, PRIOR.heading_rad])
    assert_allclose(fused.covariance[:3, :3], joint.covariance)
