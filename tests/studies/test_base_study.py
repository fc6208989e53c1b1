from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.tracks.scenes import Scene, SceneTrack
from studies.base_model.base_study import BaseOutcome, report_lines, together
from studies.protocol.cases import (
    HALVES_OF_PEOPLE,
    KNOCKED,
    Answer,
    ProtocolCase,
    draw_case,
)
from studies.protocol.estimators import base_model
from studies.protocol.learned import Learned
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site


@pytest.fixture(scope="module")
def case(lens: Intrinsics, pose: CameraPose) -> ProtocolCase:
    rng, config = np.random.default_rng(0), SiteConfig()
    walks = walk_site(lens, pose, draw_lanes(lens, pose, config, rng), config, 120, rng)
    tracks = tuple(
        SceneTrack(track_id=str(number), trajectory=walk, person_id=str(number))
        for number, walk in enumerate(walks)
    )
    scene = Scene(
        scene_id="made", intrinsics=lens, true_pose=pose, frame_rate_hz=2.5, tracks=tracks
    )
    return draw_case(scene, 1, KNOCKED, HALVES_OF_PEOPLE)


def test_the_base_model_answers_a_case_and_declares_too_few(case: ProtocolCase):
    alone = {"seen": None, "site": None, "feet": None, "feet_speed_reference": None}
    learned = Learned(case=case, **alone)  # the model goes by the tracks themselves
    found = base_model(learned)
    assert 5 <= found.tracks <= len(case.seen)
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    fewer = replace(learned, case=replace(case, seen=case.seen[:2]))
    assert base_model(fewer).identifiable == ()


def answer(value: float, variance: float) -> Answer:
    return Answer(values=np.full(3, value), covariance=variance * np.eye(3), tracks=9)


def test_a_factor_counts_a_quarter_as_much():
    # 1 and a quarter: the mean of 0 and 5 by these is 1, its variance 0.8.
    found = together(answer(0.0, 1.0), answer(5.0, 1.0))
    assert_allclose(found.values, np.ones(3))
    assert_allclose(found.covariance, 0.8 * np.eye(3), atol=1e-12)


def test_windows_are_counted_once_whatever_their_cases():
    def outcome(window: str, way: str, tilt: float, height: float) -> BaseOutcome:
        return BaseOutcome(
            window=window, way=way, error=(tilt, 0.0, height), covered=(True, True, False),
            seconds=0.5,
        )  # fmt: skip

    found = [
        outcome("a", "base model", 1.0, 3.0), outcome("a", "fused", 2.0, -2.0),
        outcome("a", "base model", -1.2, 3.0), outcome("a", "fused", 2.0, 2.0),
        outcome("b", "base model", 3.0, 1.0), outcome("b", "fused", 2.0, 2.0),
    ]  # fmt: skip
    lines = list(report_lines(found))
    assert "nearer than fused in 1 (angle) and 1 (height) of 2 windows" in lines[2]
    assert "base model" in lines[0]
    assert "3 cases" in lines[0]
    assert "1.20 (2.6) deg" in lines[0]
    assert "100, 100,   0 %" in lines[0]
    assert "a " in lines[4]
    assert "base model 1.10 deg 3.0 %" in lines[4]
