"""The studies' commands on recorded scenes."""

import json

import pytest
from typer.testing import CliRunner

from studies.__main__ import app
from tests.conftest import SCENES, path_to_small_trainings
from tests.service.commands.test_replay import offline, surefoot

__all__ = ["offline"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}"),
]


def test_centred_prints_a_table_and_writes_json_and_a_plot(offline):
    assert "town-centre" in (offline / "printed.txt").read_text()
    (run,) = json.loads((offline / "out.json").read_text())["runs"]
    assert (run["seed"], run["training_speed_mps"]) == (0, 1.4)
    assert (offline / "out.png").stat().st_size > 5000


def test_evaluate_knocks_a_scene_says_how_each_estimator_did_and_draws_it(tmp_path):
    output, plots = tmp_path / "out.json", tmp_path / "plots"
    surefoot(
        "studies", "evaluate", str(SCENES / "meva_g336_school"), "--seeds", "1",
        "--knocks", "knock",
        "--output", str(output), "--plots", str(plots),
        PYTHONPATH=path_to_small_trainings(tmp_path),
    )  # fmt: skip
    outcomes = json.loads(output.read_text())["outcomes"]
    assert len(outcomes) == 6  # estimators
    assert {outcome["estimator"] for outcome in outcomes} >= {"joint"}
    assert {outcome["knock"] for outcome in outcomes} == {"knock"}
    for name in (
        "drift-knock.png",
        "ground-meva_g336_school.png",
        "flow-meva_g336_school.png",
        "flow-tracks.png",
    ):
        assert (plots / name).stat().st_size > 5000


def test_evaluate_refuses_a_range_it_does_not_know(tmp_path):
    asked = ["evaluate", str(SCENES / "town_centre"), "--knocks", "soft"]
    answer = CliRunner().invoke(app, asked)
    assert answer.exit_code == 1
    assert "soft" in answer.output
