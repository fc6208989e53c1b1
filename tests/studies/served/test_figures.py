"""What outcomes come to, by hand."""

from dataclasses import replace

import pytest

from studies.served.figures import figures_of
from studies.served.outcomes import ParameterOutcome, ServedOutcome

RIGHT = ParameterOutcome(moved=0.0, error=0.0, sd=0.5, identifiable=True, covered=True)


def outcome(
    *parameters: ParameterOutcome, rotation_deg=0.3, height_error=0.02, cuts=0
) -> ServedOutcome:
    return ServedOutcome(
        reference_tracks=100,
        seen_tracks=50,
        used_tracks=45,
        parameters=parameters,
        rotation_deg=rotation_deg,
        height_error=height_error,
        cuts=cuts,
        mapped=True,
        reason="",
        seconds=1.0,
    )


def test_errors_and_coverage_are_of_identifiable_parameters():
    off = replace(RIGHT, error=-1.0, covered=False)
    untold = replace(RIGHT, error=9.0, sd=3.0, identifiable=False)
    far = replace(RIGHT, error=2.6, covered=False)  # 5.2 sd
    said = figures_of(
        [
            outcome(RIGHT, off, untold, RIGHT, rotation_deg=1.0),
            outcome(RIGHT, far, RIGHT, RIGHT, rotation_deg=2.0, cuts=2),
            outcome(RIGHT, RIGHT, untold, RIGHT, rotation_deg=6.0),
        ]
    )
    tilt, roll, height, heading = said.parameters
    assert (tilt.covered, tilt.error, tilt.identifiable) == (1.0, 0.0, 1.0)
    assert roll.covered == pytest.approx(1 / 3)
    assert roll.error == pytest.approx(1.0)
    assert roll.worst_sd == pytest.approx(5.2)
    assert height.identifiable == pytest.approx(1 / 3)
    assert height.covered == 1.0
    assert heading.covered == 1.0
    assert said.beyond == 1
    assert said.cut == pytest.approx(1 / 3)
    assert said.rotation_deg == 2.0
    assert said.rotation_p90_deg == pytest.approx(5.2)
    # Ten of twelve parameters are covered or not identifiable.
    assert said.sound == pytest.approx(10 / 12)
    assert said.failed == 0


def test_a_slope_is_of_told_over_true_moves():
    def moved(true, told):
        return replace(RIGHT, moved=true, error=told - true)

    rows = [
        outcome(moved(x, 0.8 * x + 0.1), moved(0.0, 0.1), RIGHT, RIGHT) for x in (-4.0, 0.0, 4.0)
    ]
    said = figures_of(rows)
    assert said.parameters[0].slope == pytest.approx(0.8)
    assert said.parameters[0].slope_se == pytest.approx(0.0, abs=1e-9)
    assert said.parameters[1].slope is None  # it was never moved


def test_a_case_of_which_nothing_is_told_counts_as_failed_and_declared():
    nothing = replace(outcome(rotation_deg=7.0), failure="too few people walk")
    said = figures_of([nothing, outcome(RIGHT, RIGHT, RIGHT, RIGHT)])
    assert said.failed == 0.5
    assert said.parameters[0].identifiable == 0.5
    assert said.sound == 1.0
    assert said.rotation_deg == pytest.approx(3.65)
    alone = figures_of([nothing])
    assert alone.parameters[0].error is None
