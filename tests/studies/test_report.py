"""Figures of the protocol, by hand."""

import math
from dataclasses import replace

import pytest

from studies.protocol.cases import Outcome
from studies.protocol.report import by_scene, overall


def outcome(seed: int, true: float, found: float, **changed: object) -> Outcome:
    """A case with a drift in tilt, roll (deg) and log height (hundredths) of the same number."""
    values: dict[str, object] = {
        "scene_id": "street",
        "estimator": "joint",
        "seed": seed,
        "tracks": 100,
        "used": 90,
        "true_drift": (true, true, true / 100),
        "drift": (found, found, found / 100),
        "sd": (0.5, 0.5, 0.01),
        "angle_error_deg": abs(found - true),
        "tilt_roll_error_deg": abs(found - true) / 2,
        "true_heading_drift_deg": 0.0,
        "height_error": abs(found - true) / 100,
        "covered": (True, True, False),
        "degenerate": False,
        "seconds": 0.5,
    }
    return Outcome(**(values | changed))  # type: ignore[arg-type]


CASES = [outcome(0, -2, -1), outcome(1, 0, 0), outcome(2, 2, 3), outcome(3, 0, 2)]


def test_medians_and_shares_of_a_scene():
    (figures,) = by_scene(CASES)
    assert figures.angle_error_deg == 1.0
    assert figures.angle_error_p90_deg == pytest.approx(1.7)
    assert figures.tilt_roll_error_deg == 0.5
    assert figures.height_error == pytest.approx(0.01)
    assert figures.coverage == pytest.approx(2 / 3)
    # Beyond four standard deviations, 2 deg: the third alone.
    assert figures.drifting == 0.25
    assert figures.cases == 4
    assert figures.heading_error_deg is None
    panned = [
        replace(o, heading_error_deg=h, heading_covered=h < 2)
        for o, h in zip(CASES, (1.0, 3.0, 1.5, 1.2), strict=True)
    ]
    assert by_scene(panned)[0].heading_error_deg == pytest.approx(1.35)
    assert by_scene(panned)[0].heading_coverage == 0.75


def test_slopes_are_least_squares():
    (figures,) = overall(CASES)
    # true -2, 0, 2, 0 and found -1, 0, 3, 2: covariance 8, variance 8; residuals 0, -1, 0, 1.
    assert figures.slope == pytest.approx((1.0, 1.0, 1.0))
    assert figures.slope_se is not None
    assert figures.slope_se[0] == pytest.approx(math.sqrt(2 / 2 / 8))
    assert figures.coverage == (1.0, 1.0, 0.0)


def test_the_slope_of_the_heading_is_that_of_those_who_say_it():
    panned = [
        replace(o, true_heading_drift_deg=true, heading_error_deg=error, heading_covered=error < 2)
        for o, true, error in zip(CASES, (-2.0, 0.0, 2.0, 0.0), (1.0, 0.0, 1.0, 2.0), strict=True)
    ]
    (figures,) = overall(panned)
    # As above: true -2, 0, 2, 0 and found -1, 0, 3, 2.
    assert figures.heading_slope == pytest.approx(1.0)
    assert figures.heading_slope_se == pytest.approx(math.sqrt(2 / 2 / 8))
    assert figures.heading_coverage == 0.75
    (silent,) = overall(CASES)
    assert (silent.heading_slope, silent.heading_coverage) == (None, None)
    (unpanned,) = overall([replace(o, true_heading_drift_deg=0.0) for o in panned])
    assert (unpanned.heading_slope, unpanned.heading_coverage) == (None, 0.75)


def test_a_scene_with_few_tracks_has_no_say_in_the_slope():
    few = [outcome(seed, 5 * (seed % 3 - 1), 0, scene_id="lane", tracks=69) for seed in range(6)]
    (figures,) = overall([*CASES, *few])
    assert figures.slope == pytest.approx((1.0, 1.0, 1.0))
    (alone,) = overall(few)
    assert alone.slope is None
    assert alone.cases == 6


def test_estimators_and_scenes_are_kept_apart():
    other = outcome(0, 0, 4, estimator="averaged")
    names = [(figures.scene_id, figures.estimator) for figures in by_scene([*CASES, other])]
    assert names == [("street", "joint"), ("street", "averaged")]
    assert [figures.estimator for figures in overall([*CASES, other])] == ["joint", "averaged"]
