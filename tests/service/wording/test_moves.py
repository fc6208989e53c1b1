"""The sentence at the top of a camera's page, from what an estimate tells."""

import math
from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest

from service.store.estimates import EstimateRecord
from service.wording.moves import angle_half_width_deg, moved_words, signed
from service.wording.times import Clock

EVERYTHING = ["tilt", "roll", "height", "heading"]


def estimate(
    identifiable=EVERYTHING, drifted=("tilt",), sd_deg=0.2, height_m=0.0, sd_m=0.06, **angles_deg
):
    drifts = {f"drift_{name}_rad": math.radians(value) for name, value in angles_deg.items()}
    return EstimateRecord(
        identifiable=list(identifiable),
        drifted=list(drifted),
        tilt_sd_rad=math.radians(sd_deg),
        roll_sd_rad=math.radians(sd_deg),
        heading_sd_rad=math.radians(sd_deg),
        height_sd_m=sd_m,
        drift_height_m=height_m,
        drift_angle_rad=math.radians(math.hypot(*angles_deg.values())),
        **{f"drift_{name}_rad": 0.0 for name in ("tilt", "roll", "heading")} | drifts,
    )


def test_a_turn_names_what_counts_pan_first():
    found = estimate(tilt=-1.2, heading=4.9, roll=0.1)
    assert moved_words(found) == "turned 5.0° (pan +4.9°, tilt −1.2°)"
    assert moved_words(found, "14:32") == "turned 5.0° (pan +4.9°, tilt −1.2°) about 14:32"


def test_what_is_within_its_own_interval_is_not_named():
    assert moved_words(estimate(tilt=5.0, roll=0.9, sd_deg=0.6)) == "turned 5.1° (tilt +5.0°)"


def test_a_number_that_is_not_told_is_not_named():
    found = estimate(identifiable=["roll"], tilt=5.0, roll=2.0)
    assert "tilt" not in moved_words(found)


def test_a_raised_camera():
    both = estimate(tilt=5.0, height_m=0.24)
    assert moved_words(both, "9:00") == "turned 5.0° (tilt +5.0°) about 9:00 and is 0.24 m higher"
    alone = estimate(tilt=0.1, drifted=["height"], height_m=-0.45)
    assert moved_words(alone, "9:00") == "is 0.45 m lower than it should be, since about 9:00"
    unsure = estimate(tilt=5.0, height_m=0.24, sd_m=0.2)
    assert moved_words(unsure) == "turned 5.0° (tilt +5.0°)"


def test_how_sure_is_along_the_turn():
    # Of 3 and 4 deg each known to 0.2: the length of 5 is, too; 90 of 100 is 1.644854 sd.
    assert angle_half_width_deg(estimate(tilt=3.0, roll=4.0)) == pytest.approx(0.3289707)
    assert angle_half_width_deg(estimate(tilt=0.01)) == pytest.approx(0.3289707)
    assert angle_half_width_deg(estimate(identifiable=["height"])) is None


@pytest.mark.parametrize(
    ("value", "text"), [(0.04, "0.0"), (-0.04, "0.0"), (-1.25, "−1.2"), (3.0, "+3.0")]
)
def test_signs(value, text):
    assert signed(value, 1) == text


@pytest.mark.parametrize(
    ("at", "text"),
    [
        ("2026-11-20T13:32:00", "14:32"),
        ("2026-11-19T13:32:00", "14:32 yesterday"),
        ("2026-11-21T07:00:00", "08:00 tomorrow"),
        ("2026-11-16T13:32:00", "14:32 on Monday"),
        ("2026-03-03T13:32:00", "3 Mar, 14:32"),
        ("2025-03-03T13:32:00", "3 Mar 2025, 14:32"),
        ("2026-11-19T23:30:00", "00:30"),  # it is today there, if not in Greenwich
    ],
)
def test_times_are_said_by_the_cameras_clock(at, text):
    now = datetime(2026, 11, 20, 16, tzinfo=UTC)
    berlin = ZoneInfo("Europe/Berlin")
    clock = Clock(now=now, zone=berlin)
    assert clock.when(datetime.fromisoformat(at).replace(tzinfo=UTC)) == text
