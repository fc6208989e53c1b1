"""Warming up asks for everything: after it an estimate finds all that it needs compiled."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

import models
from models.assessment.warm_up import warm_up

ROOT = Path(models.__path__[0]).parent
ASK = """
import gc
from models.compiled import _Compiled
from models.assessment import AlarmRate, alarm_chart_result
from models.pose import estimate_pose, learn_site, observe
from models.assessment.warm_up import warm_up
from models.tracks.trajectory import by_end
from tests.models.sites import KNOCKED, LENS, PRIOR, tracks_of

def kinds():
    made = [each for each in gc.get_objects() if isinstance(each, _Compiled) and each._made]
    return sorted((each.__qualname__, str(kind)) for each in made for kind in each.signatures)

warm_up()
before = kinds()
known, after = tracks_of(5, (PRIOR, 30), (KNOCKED, 20))
site = learn_site(observe(by_end(known), LENS, PRIOR), LENS, PRIOR)
window = observe(by_end(after), LENS, PRIOR)
estimate_pose(window, site)
alarm_chart_result(window, site, AlarmRate(alarms_a_year=1.0, tracks_a_year=1e4))
print(len(before) > 20, kinds() == before)
"""


def test_it_finds_the_knock_of_its_site():
    assert math.degrees(warm_up().fused.parameters.tilt_rad) == pytest.approx(18 + 5, abs=1)


def test_an_estimate_after_it_compiles_nothing():
    told = subprocess.run(
        [sys.executable, "-c", ASK], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == ["True", "True"]
