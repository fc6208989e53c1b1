"""The creep study: what it says of cases, and that a simulated creep is noticed."""

import json
from dataclasses import replace

import pytest
from rich.console import Console

from studies.alarms.slow_drift_run import _kept, run_slow_drift_study, slow_drift_table
from studies.alarms.slow_drift_years import Life, SlowDriftCase, SlowDriftPlan, slow_drift_case
from studies.code_hash import code_hash

PLAN = SlowDriftPlan(
    tracks_a_day=18.0, reference_tracks=200, alarms_a_year=1.0, days=60, still_days=0
)
CASE = SlowDriftCase(
    site=0, seed=0, number="tilt", rate_deg=0.5, days=90, groups=190.0, told_deg=1.4,
    said_number="tilt", said_deg=1.3, said_sd_deg=0.2, alarms=1, highest=1.1,
)  # fmt: skip


def test_a_creep_that_was_never_noticed_is_the_worst():
    cases = [CASE, replace(CASE, site=1, told_deg=None), replace(CASE, site=2, told_deg=0.9)]
    console = Console(width=120)
    with console.capture() as capture:
        console.print(slow_drift_table(cases))
    assert "1.40, inf, inf (n 3)" in capture.get()


@pytest.mark.parametrize(("code", "kept"), [(None, 1), ("0" * 12, 0)])
def test_cases_by_the_same_plan_and_code_are_not_run_again(tmp_path, code, kept):
    code = code or code_hash()
    output = tmp_path / "creep.json"
    plan = {name: getattr(PLAN, name) for name in PLAN.__slots__}
    case = {name: getattr(CASE, name) for name in CASE.__slots__}
    output.write_text(json.dumps({"code": code, "plan": plan, "results": [case]}))
    assert len(_kept(output, PLAN)) == kept
    if kept:
        run_slow_drift_study(sites=1, seed=0, plan=PLAN, processes=1, output=output)
        assert json.loads(output.read_text())["results"] == [case]


@pytest.mark.slow
def test_a_simulated_camera_that_creeps_is_noticed_and_twice_the_same():
    life = Life(0, 0, PLAN)
    found = slow_drift_case(life.again(), "tilt", 1.0, PLAN.days)
    assert found.told_deg < 2.0
    assert found.said_number == "tilt"
    assert abs(found.said_deg - found.told_deg) < 4 * found.said_sd_deg
    assert slow_drift_case(life.again(), "tilt", 1.0, PLAN.days) == found
