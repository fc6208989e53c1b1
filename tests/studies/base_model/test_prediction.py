"""The shipped base model, before cameras and people of a simulator that it never saw."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.errors import TooFewTrajectoriesError
from models.geometry.ground import pixel_from_ground
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, plane_parameters_of
from models.simulation.poses import PoseOffset
from studies.base_model.network import SetNetwork
from studies.base_model.prediction import base_estimate
from studies.base_model.segments import Segments, segments_of
from studies.base_model.stored import load_base_model
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site

pytestmark = pytest.mark.slow

KNOCK = PoseOffset(tilt_rad=radians(4), roll_rad=radians(-5), log_height=0.1)


@pytest.fixture(scope="module")
def network() -> SetNetwork:
    return load_base_model()


def seen_twice(
    lens: Intrinsics, pose: CameraPose, moved: CameraPose, seed: int
) -> tuple[Segments, Segments]:
    rng, config = np.random.default_rng(seed), SiteConfig(noise_px=0.5)
    lanes = draw_lanes(lens, pose, config, rng)
    reference, seen = (walk_site(lens, at, lanes, config, 60, rng) for at in (pose, moved))
    return segments_of(reference, lens), segments_of(seen, lens)


def test_a_knock_is_found_at_once(network: SetNetwork, lens: Intrinsics, pose: CameraPose):
    moved = KNOCK.apply(pose)
    errors, covered = [], []
    for seed in range(6):
        reference, seen = seen_twice(lens, pose, moved, seed)
        found = base_estimate(network, lens, pose, seen, reference)
        error = found.values - plane_parameters_of(moved)
        errors.append(error)
        covered.append(np.abs(error) < 3 * np.sqrt(np.diag(found.covariance)))
    median = np.median(np.abs(errors), axis=0)
    assert median[0] < radians(0.8)
    assert median[1] < radians(1.6)
    assert median[2] < 0.06
    assert np.mean(covered) > 0.7


def test_without_a_reference_people_are_taken_to_walk_as_most_do(
    network: SetNetwork, lens: Intrinsics, pose: CameraPose
):
    _, seen = seen_twice(lens, pose, pose, 1)
    found = base_estimate(network, lens, pose, seen, None)
    error = np.abs(found.values - plane_parameters_of(pose))
    assert error[0] < radians(2.5)
    assert error[1] < radians(3.5)
    known = base_estimate(network, lens, pose, seen, seen)
    assert known.covariance[2, 2] < found.covariance[2, 2]


def test_another_lens_and_tilt_before_the_same_people_are_told_the_same(
    network: SetNetwork, lens: Intrinsics
):
    """Ways in the levelled frame are all that counts, not which pixels show them."""
    rng = np.random.default_rng(3)
    begin = rng.uniform((-4, 10), (4, 20), (40, 2))
    ways = begin[:, None] + np.linspace(0, 1, 5)[:, None] * rng.uniform(-6, 6, (40, 1, 2))
    poses = [CameraPose(height_m=6.0, tilt_rad=radians(tilt)) for tilt in (12, 35)]
    lenses = [lens, replace(lens, fx=700.0, fy=720.0, distortion=(-0.05, 0.0, 0.0, 0.0, 0.0))]
    offsets = []
    for pose, own in zip(poses, lenses, strict=True):
        uv, _ = pixel_from_ground(own, pose.rotation, pose.centre_m, ways)
        seen = Segments(
            nodes_uv=uv, duration_s=np.full(40, 4.0), owner_idx=np.arange(40),
            residual_px=np.full(40, 1e-3 * np.sqrt(own.fx * own.fy)),
        )  # fmt: skip
        found = base_estimate(network, own, pose, seen, None)
        offsets.append(found.values - plane_parameters_of(pose))
    # Tilt and height are the same numbers of either camera; a roll is by its tilt's cosine more.
    assert_allclose(offsets[0][[0, 2]], offsets[1][[0, 2]], atol=2e-2)


def test_too_few_who_walk_are_counted(network: SetNetwork, lens: Intrinsics, pose: CameraPose):
    reference, seen = seen_twice(lens, pose, pose, 0)
    few = seen.take(np.flatnonzero(seen.owner_idx < np.unique(seen.owner_idx)[4]))
    with pytest.raises(TooFewTrajectoriesError, match="at least 5 .* needed, got 4"):
        base_estimate(network, lens, pose, few, reference)
