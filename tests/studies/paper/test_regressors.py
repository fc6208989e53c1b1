"""Table 1: a constant is right in the middle and nowhere else; epochs are chosen as they say."""

from dataclasses import replace
from pathlib import Path

import pytest

from models.regression import training
from studies.paper import regressors
from studies.paper.part import PaperCase, PaperResult
from studies.paper.regressors import CONSTANT, run_case
from studies.paper.regressors_table import REGRESSORS
from tests.studies.test_partings import scene_of

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def made_up(monkeypatch):
    scene = scene_of([30.0 * number for number in range(16)])
    monkeypatch.setattr(regressors, "load_scene", lambda _: scene)
    monkeypatch.setattr(training, "_HELD_OUT_WALKS", 50)
    monkeypatch.setattr(regressors, "_HELD_OUT", 50)
    return scene


def case_of(variant):
    return PaperCase(part="regressors", scene="made-up", variant=variant, seed=0)


def run(variant):
    return run_case(case_of(variant), Path("made-up"), lambda _: None)


def test_a_constant_is_right_in_the_middle_and_follows_no_knock():
    found = run(CONSTANT)
    assert found["centred_height_m"] == 0
    assert found["centred_deg"] == pytest.approx(0, abs=1e-5)
    assert found["knocked_deg"] > 3  # of up to 8 deg of tilt and of roll
    slopes = [found[f"slope_{name}"] for name in ("tilt", "roll", "height")]
    assert slopes == pytest.approx([0, 0, 0], abs=1e-9)


def test_an_epoch_chosen_by_the_tracks_themselves_flatters(monkeypatch):
    def few(plan):
        recipe = replace(
            plan.recipe, poses="random", random_poses=60, walks_per_pose=2, batch=40, epochs=4
        )
        return replace(plan, recipe=recipe)

    monkeypatch.setitem(regressors.VARIANTS, "paper", few)
    shares = []
    found = run_case(case_of("paper"), Path("made-up"), shares.append)
    assert shares[-1] == 1
    assert shares == sorted(shares)
    for other in ("centred", "by_held_out"):
        angle = 0.035 * found[f"{other}_deg"]  # more than the loss has of a small angle
        assert found["by_test_height_m"] <= found[f"{other}_height_m"] + angle
    table = REGRESSORS.table(
        [PaperResult(case=case_of("paper"), figures=found, seconds=1.0, code="")]
    )
    header, _, row = table.splitlines()
    assert header.count("|") == row.count("|")
    assert f"{found['centred_height_m']:.2f}, {found['centred_deg']:.2f}" in row
