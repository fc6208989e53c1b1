"""Wheels, runners, standers, ramps and wrong lenses, by numbers worked out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from studies.faults.catalogue import FAULTS
from studies.faults.lens_and_ground import (
    ramp,
    stairs,
    wrong_focal_length,
    wrong_k1,
    wrong_principal_point,
)
from studies.faults.traffic import cars, cyclists, other_paths, runners, standers, strollers
from tests.studies.faults.sights import places_of, straight, view_on, walk

VIEW = view_on([(-8, 20), (8, 40), (0, 30), (4, 25)])


def crowd(count, tall_m=1.75):
    """People who walk 20 m across the picture at 1 m/s, each 20 to 40 m away."""
    depths = np.linspace(20, 40, count)
    return [
        walk(str(n), straight((-10, y), (10, y), 201), tall_m=tall_m) for n, y in enumerate(depths)
    ]


@pytest.mark.parametrize(
    ("injector", "kind", "speed_mps"), [(cyclists, "cyclist", 4.2), (runners, "runner", 3.0)]
)
def test_riders_and_runners_take_the_same_ways_at_their_own_pace(injector, kind, speed_mps):
    people = crowd(60)
    found = injector(people, VIEW, 1.0, 0)
    assert {t.track_id for t in found} == {f"{kind}-{n}" for n in range(60)}
    speeds = []
    for track in found:
        ground = places_of(track)
        assert_allclose(ground[:, 1], ground[0, 1], rtol=1e-6)  # on its own line
        assert_allclose(ground[0, 0], -10, atol=1e-6)
        steps = np.diff(ground[:, 0]) / 0.1
        assert_allclose(steps, steps[0], rtol=1e-6)  # steadily
        speeds.append(steps[0])
    assert np.median(speeds) == pytest.approx(speed_mps, rel=0.08)
    assert_allclose(np.diff(found[0].trajectory.time_s), 0.1)


def test_a_share_is_replaced_the_same_people_wherever_the_camera_is():
    people = crowd(200)
    found = {t.track_id for t in cyclists(people, VIEW, 0.2, 3)}
    riders = {name for name in found if name.startswith("cyclist-")}
    assert len(found) == 200
    assert len(riders) == pytest.approx(40, abs=16)
    some = {t.track_id for t in cyclists(people[50:120], VIEW, 0.2, 3)}
    assert some == found & {f"{p}{n}" for p in ("", "cyclist-") for n in range(50, 120)}


def test_a_car_is_seen_by_its_near_side():
    (person,) = crowd(1)  # 20 m away
    (car,) = cars([person], VIEW, 1.0, 0)
    ground = places_of(car)
    # Straight ahead the near side is 0.9 m nearer: v = 500 + 5000 / 19.1.
    middle = np.abs(ground[:, 0]).argmin()
    assert car.trajectory.uv[middle, 1] == pytest.approx(761.78, abs=0.1)
    assert_allclose(car.trajectory.top_v, 500 + 1000 * 3.5 / 20, atol=1e-6)


def test_other_paths_are_the_old_ones_left_for_right_at_the_same_pace():
    # The middle of the site is straight ahead, so that x becomes -x.
    view = view_on([(-3, 30), (0, 30), (3, 30)])
    one = walk("a", straight((1, 20), (4, 30), 51), tall_m=1.8)
    (other,) = other_paths([one], view, 1.0, 0)
    assert_allclose(places_of(other), straight((-1, 20), (-4, 30), 51), atol=1e-6)
    assert_allclose(other.trajectory.top_v, one.trajectory.top_v, atol=1e-6)
    assert_allclose(other.trajectory.time_s, one.trajectory.time_s)


def test_a_stroller_is_the_lower_edge_where_it_is_nearer():
    towards = walk("a", straight((0, 40), (0, 20), 201))
    away = walk("b", straight((0, 20), (0, 40), 201))
    near, far = strollers([towards, away], VIEW, 1.0, 0)
    # Pushed towards the camera its wheel is 0.9 m nearer than the feet, which begin at 40 m.
    assert places_of(near)[0, 1] == pytest.approx(39.1, abs=1e-6)
    assert places_of(far)[0, 1] == pytest.approx(20.0, abs=1e-6)


def test_who_stops_stands_for_20_to_60_seconds_and_walks_on():
    for track in standers(crowd(20), VIEW, 1.0, 0):
        ground = places_of(track)
        still = np.diff(ground[:, 0]) < 1e-6
        assert 19.8 <= 0.1 * still.sum() <= 60.1
        assert np.diff(np.flatnonzero(still)).max() == 1  # once
        assert ground[-1, 0] > 9.0  # on to the end


def test_a_ramp_rises_by_its_grade_beyond_a_line():
    grid = [(x, y) for x in np.linspace(-8, 8, 9) for y in np.linspace(20, 40, 9)]
    view = view_on(grid)
    people = [walk(str(n), [place, place]) for n, place in enumerate(grid)]
    found = ramp(people, view, 0.05, 2)
    # v = 500 + 1000 (5 - z) / y
    rise = np.array(
        [
            5 - (t.trajectory.uv[0, 1] - 500) * y / 1000
            for t, (_, y) in zip(found, grid, strict=True)
        ]
    )
    assert (rise > -1e-9).all()
    up = rise > 1e-9
    assert up.mean() == pytest.approx(0.5, abs=0.05)
    design = np.column_stack([np.array(grid)[up], np.ones(up.sum())])
    gradient = np.linalg.lstsq(design, rise[up], rcond=None)[0][:2]
    assert np.hypot(*gradient) == pytest.approx(0.05)


def test_a_flight_of_stairs_is_slow_steep_and_ends_on_a_floor():
    grid = [(x, y) for x in np.linspace(-8, 8, 9) for y in np.linspace(20, 40, 9)]
    view = view_on(grid)
    across = [
        walk(str(n), straight((-8, y), (8, y), 161)) for n, y in enumerate((22.0, 30.0, 38.0))
    ]
    found = stairs(across, view, 1.7, 2)
    assert len(found) == 3
    slowest = 0.0
    for before, after, y in zip(across, found, (22.0, 30.0, 38.0), strict=True):
        rise = 5 - (after.trajectory.uv[:, 1] - 500) * y / 1000  # v = 500 + 1000 (5 - z) / y
        x = (after.trajectory.uv[:, 0] - 1000) * y / 1000
        assert (rise > -1e-9).all()
        assert (rise < 1.7 + 1e-9).all()
        took = np.diff(after.trajectory.time_s) / np.diff(before.trajectory.time_s)[0]
        flight = (rise > 1e-9) & (rise < 1.7 - 1e-9)
        either = flight[1:] | flight[:-1]
        assert_allclose(took, np.where(either, 2.5, 1.0), rtol=1e-6)
        slowest = max(slowest, float(took.max()))
        assert_allclose(np.diff(x), 0.1, atol=1e-9)  # seen from above, the same places
    assert slowest == pytest.approx(2.5)


def test_a_wrong_lens_moves_pixels_by_hand():
    one = walk("a", [[2.0, 20.0], [2.0, 20.0 + 1e-9]])  # at (1100, 750)
    (longer,) = wrong_focal_length([one], VIEW, 0.05, 0)
    assert_allclose(longer.trajectory.uv[0], [1105, 762.5], atol=1e-6)
    (bent,) = wrong_k1([one], VIEW, 0.05, 0)
    # r^2 = 0.1^2 + 0.25^2 = 0.0725, so rays are 1 + 0.05 * 0.0725 = 1.003625 as long.
    assert_allclose(bent.trajectory.uv[0], [1100.3625, 750.90625], atol=1e-6)
    (aside,) = wrong_principal_point([one], VIEW, 0.02, 0)
    assert np.hypot(*(aside.trajectory.uv[0] - [1100, 750])) == pytest.approx(40.02)


def test_every_fault_of_the_catalogue_keeps_to_the_picture_and_to_its_seed():
    lens = VIEW.intrinsics
    for name, fault in FAULTS.items():
        found = fault.inject(crowd(40), VIEW, 7)
        again = fault.inject(crowd(40), VIEW, 7)
        assert len(found) >= 20, name
        for one, other in zip(found, again, strict=True):
            assert lens.contains(one.trajectory.uv).all(), name
            assert (one.trajectory.uv == other.trajectory.uv).all(), name
            assert (one.trajectory.time_s == other.trajectory.time_s).all(), name
        changed = {
            t.track_id: t.trajectory.uv.tobytes() + t.trajectory.time_s.tobytes() for t in found
        }
        assert changed != {
            t.track_id: t.trajectory.uv.tobytes() + t.trajectory.time_s.tobytes() for t in crowd(40)
        }, name


def test_a_fault_says_nothing_where_nobody_is():
    for fault in FAULTS.values():
        assert fault.inject([], VIEW, 0) == []
