"""The regressors as the protocol calls them, after trainings too short to be good."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, array_of
from models.regression import training
from models.regression.averaging import average_windows, averaged_estimate
from models.regression.network import predict_windows
from models.regression.recipe import DEFAULT, TrainingPlan, plan_training
from models.regression.training import train
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory, choose_step_s, cut_windows
from studies.protocol import regressors
from studies.protocol.cases import (
    KNOCKED,
    Answer,
    Estimator,
    ProtocolCase,
    draw_case,
    judge_answer,
)
from studies.protocol.regressors import prepare_regressors
from studies.simulation.crowds import FlowConfig
from studies.simulation.flows import simulate_sites

pytestmark = pytest.mark.slow

NAMES = {"averaged", "calibrated"}


def tiny_plan(**asked: object) -> TrainingPlan:
    plan = plan_training(**asked)  # type: ignore[arg-type]
    return replace(plan, recipe=replace(plan.recipe, random_poses=40, walks_per_pose=2, batch=40))


@pytest.fixture(scope="module", autouse=True)
def tiny() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(regressors, "plan_training", tiny_plan)
        patch.setattr(training, "_HELD_OUT_WALKS", 100)
        patch.setattr(training, "_CENTRING_WALKS", 100)
        patch.setattr(
            regressors, "learn_calibration", partial(regressors.learn_calibration, sites=60)
        )
        yield


@pytest.fixture(scope="module")
def scene(lens: Intrinsics, pose: CameraPose) -> Scene:
    (walks,) = simulate_sites(
        lens, [repeated_pose(pose, 1)], 120, FlowConfig(slow_share=(0.0, 0.0)), WalkConfig(),
        np.random.default_rng(0),
    )  # fmt: skip
    tracks = tuple(
        SceneTrack(
            track_id=str(number),
            trajectory=Trajectory(time_s=0.4 * np.arange(length) + number, uv=uv[:length]),
            person_id=str(number),
        )
        for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True))
    )
    return Scene(scene_id="made", intrinsics=lens, true_pose=pose, frame_rate_hz=2.5, tracks=tracks)


@pytest.fixture(scope="module")
def estimators(scene: Scene) -> Mapping[str, Estimator]:
    return prepare_regressors(scene, seed=0, epochs=1)


def answers(estimators: Mapping[str, Estimator], case: ProtocolCase) -> dict[str, Answer]:
    return {name: estimator(case) for name, estimator in estimators.items()}


def test_every_estimator_answers_a_case(scene: Scene, estimators: Mapping[str, Estimator]):
    case = draw_case(scene, 3, KNOCKED)
    said = answers(estimators, case)
    assert set(said) == NAMES | {f"{name}_reference" for name in NAMES}
    for name, answer in said.items():
        assert 0 < answer.tracks <= len(case.seen)
        assert np.linalg.eigvalsh(answer.covariance).min() > 0
        judge_answer(case, name, answer, 0.0)


def test_the_seed_alone_makes_the_answers(scene: Scene, estimators: Mapping[str, Estimator]):
    case = draw_case(scene, 1, KNOCKED)
    again = answers(prepare_regressors(scene, seed=0, epochs=1), case)
    for name, answer in answers(estimators, case).items():
        assert_array_equal(answer.values, again[name].values)


def test_averaged_is_what_the_service_averages(scene: Scene, estimators: Mapping[str, Estimator]):
    case = draw_case(scene, 2, KNOCKED)
    tracks = [track.trajectory for track in scene.tracks]
    step_s = choose_step_s(tracks)
    plan = tiny_plan(
        intrinsics=scene.intrinsics, prior_pose=scene.true_pose, recipe_name=DEFAULT.name,
        walk=WalkConfig(step_s=step_s), seed=0, epochs=1,
    )  # fmt: skip
    network, _ = train(plan)
    windows = cut_windows(case.seen, scene.intrinsics, step_s)
    height_m, q = predict_windows(network, windows, plan)
    estimate = averaged_estimate(average_windows(height_m, q, windows.owner_idx)[1], 0)
    said = estimators["averaged"](case)
    expected = array_of(estimate.value)[:3]
    assert_allclose(said.values, expected, atol=1e-9)
    sd = np.sqrt(np.diag(said.covariance))
    assert_allclose(sd[:2], [estimate.sd.tilt_rad, estimate.sd.roll_rad], rtol=0.25)


def test_only_those_of_the_reference_look_at_it(scene: Scene, estimators: Mapping[str, Estimator]):
    case = draw_case(scene, 4, KNOCKED)
    fewer = replace(case, reference=case.reference[: len(case.reference) // 2])
    for name in NAMES:
        alone, beside = estimators[name], estimators[f"{name}_reference"]
        assert_array_equal(alone(case).values, alone(fewer).values)
        assert np.abs(beside(case).values - beside(fewer).values).max() > 1e-9


def test_hardly_a_track_is_declared(scene: Scene, estimators: Mapping[str, Estimator]):
    case = draw_case(scene, 0, KNOCKED)
    for answer in answers(estimators, replace(case, seen=case.seen[:2])).values():
        assert answer.identifiable == ()
        assert answer.tracks == 0


def test_progress_climbs_to_one(scene: Scene):
    shares: list[float] = []
    prepare_regressors(scene, seed=0, epochs=2, on_progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert shares[0] < 0.3
