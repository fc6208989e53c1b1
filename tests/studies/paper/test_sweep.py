"""The sweep of training speeds: a slow clock is people in a hurry, and the service says so."""

from dataclasses import replace

import numpy as np
import pytest

from models.tracks.scenes import SceneTrack
from studies.paper.part import PaperCase, PaperResult
from studies.paper.sweep import (
    SLOW_CLOCK,
    SPEED_SWEEP,
    SPEEDS_MPS,
    _by_a_slow_clock,
    _said_of_the_clock,
    parted,
)
from tests.studies.test_partings import scene_of

SCENE = scene_of([30.0 * number for number in range(16)])  # 12 m in 10 s
# Somebody who came before others and ended after them: a service is told of them later.
SLOWEST = SCENE.tracks[1].trajectory
SCENE = replace(
    SCENE,
    tracks=(
        *SCENE.tracks,
        SceneTrack(
            track_id="slow",
            trajectory=replace(SLOWEST, time_s=SLOWEST.time_s[0] + 0.41 * np.arange(26) * 10),
        ),
    ),
)


def test_speeds_are_those_of_the_paper():
    assert SPEEDS_MPS[0] == 0.2
    assert SPEEDS_MPS[-1] == 4.0
    assert np.diff(SPEEDS_MPS) == pytest.approx(0.2)


def test_a_slow_clock_makes_people_hurry_and_is_doubted():
    said = _said_of_the_clock(SCENE)
    assert said["walking_speed_mps"] == pytest.approx(1.2, rel=0.03)
    assert not said["clock_doubted"]
    said = _said_of_the_clock(_by_a_slow_clock(SCENE))
    assert said["walking_speed_mps"] == pytest.approx(3.0, rel=0.03)
    assert said["clock_doubted"]


def test_the_table_names_the_floor():
    figures = {
        f"{SLOW_CLOCK} at {speed:g} m/s": {"height_m": abs(speed - 3.4) + 0.1, "deg": 1.0}
        for speed in SPEEDS_MPS
    } | {
        "served": {"walking_speed_mps": 1.4, "clock_doubted": 0.0},
        "served, a clock 2.5 times too slow": {"walking_speed_mps": 3.5, "clock_doubted": 1.0},
    }
    results = [
        PaperResult(
            case=PaperCase(part="speed-sweep", scene="a", variant=variant, seed=0),
            figures=found,
            seconds=1.0,
            code="",
        )
        for variant, found in figures.items()
    ]
    assert set(figures) <= {each.variant for each in SPEED_SWEEP.cases(["a"])}
    assert parted(results[0].case.variant) == (SLOW_CLOCK, 0.2)
    row = SPEED_SWEEP.table(results).splitlines()[2].split(" | ")
    assert row[2:5] == ["20 of 20", "3.4", "3.50, which it doubts"]
    assert row[7] == "2.10, 1.0"  # at 1.4 m/s


def test_nothing_is_drawn_of_the_service_alone(tmp_path):
    case = PaperCase(part="speed-sweep", scene="a", variant="served", seed=0)
    told = {"walking_speed_mps": 1.4, "clock_doubted": 0.0}
    trained = replace(case, variant=f"{SLOW_CLOCK} at 1.4 m/s")
    served = PaperResult(case=case, figures=told, seconds=1.0, code="")
    assert SPEED_SWEEP.plot is not None
    SPEED_SWEEP.plot([served], tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()
    one = replace(served, case=trained, figures={"height_m": 0.1, "deg": 1.0})
    SPEED_SWEEP.plot([served, one], tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 1000
