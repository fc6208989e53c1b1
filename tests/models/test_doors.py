"""Doors, against numbers by hand: who ends where, at what rate, and what that says of a pose.

The cameras of the map look straight down with the top of the picture north, 5 m high: a ray
(x, y, 1) lands at (5 x, -5 y) m, and turning the camera clockwise takes the ground along.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.doors.choosing import Part, best_door_grain
from models.doors.door_map import DoorGrain, DoorMap, Nodes, around, count_at, door_map_of
from models.doors.likelihood import anchored_door_scores, door_likelihood, door_values
from models.geometry.ground import pixel_from_ground
from models.tracks.exposure import BEGINS, ENDS, Moments, observe_moments
from models.tracks.trajectory import Trajectory
from tests.models.sites import LENS, PRIOR

HEIGHT_M = 5.0
DOWN = np.array([math.pi / 2, 0.0, math.log(HEIGHT_M), 0.0])
AHEAD = np.array([0.5, 0.05, math.log(HEIGHT_M), 0.3])
FEW = 5.0  # events that `often` begins with
NODES = Nodes(corner=np.array([-10.0, -10.0]), cell_m=0.25, size=(81, 81))
GRAIN = DoorGrain(smooth_m=0.5, alike=False)


def walk(start: tuple, end: tuple, since_s: float, seconds: float = 12.0) -> Trajectory:
    """A walk on the ground between two places, in metres, as the prior pose sees it at 10 Hz."""
    time_s = np.arange(0, seconds + 1e-6, 0.1)
    ground = np.linspace(start, end, time_s.size)
    uv, valid = pixel_from_ground(LENS, PRIOR.rotation, PRIOR.centre_m, ground)
    assert valid.all()
    return Trajectory(time_s=since_s + time_s, uv=uv)


def moments_at(places: list, event: list, seconds: list | None = None) -> Moments:
    """One moment a track, on the ground below a camera that looks straight down."""
    rays = [[x / HEIGHT_M, -y / HEIGHT_M, 1.0] for x, y in places]
    count = len(places)
    seconds = [0.0] * count if seconds is None else seconds
    return Moments(
        rays=np.array(rays),
        owner_idx=np.arange(count),
        seconds=np.stack([np.array(seconds, dtype=float)] * 2, axis=1),
        event=np.array(event),
        log_size=np.full(count, 5.0),
        owners=count,
    )


def door_at(x: float, y: float, times: float = 20.0, rate: float = 0.1) -> DoorMap:
    """A door that is so many times likelier than elsewhere, 0.5 m wide."""
    at = np.indices(NODES.size) * NODES.cell_m + NODES.corner[:, None, None]
    bump = np.exp(-((at[0] - x) ** 2 + (at[1] - y) ** 2) / (2 * 0.5**2))
    return DoorMap(
        corner=NODES.corner,
        cell_m=NODES.cell_m,
        ratio=np.stack([1 + (times - 1) * bump] * 2, axis=2),
        known=np.ones(NODES.size),
        log_size=np.linspace(4.0, 6.0, 8),
        rate=np.full((2, 8), rate),
        weight=1.0,
    )


def test_a_walk_ends_where_it_ends_in_sight_and_not_at_the_border():
    others = [walk((-3, 14), (3, 14), since) for since in (-40.0, 60.0)]
    vanishes = walk((-3, 14), (3, 16), 0.0)
    leaves = walk((0, 14), (12, 14), 5.0)
    assert not LENS.contains(leaves.uv)[-1]
    inside = leaves.part(np.flatnonzero(LENS.contains(leaves.uv)))
    moments = observe_moments([others[0], vanishes, inside, others[1]], LENS, PRIOR)
    ends = moments.owner_idx[moments.event == ENDS]
    assert_array_equal(ends, [0, 1, 3])
    assert_array_equal(moments.owner_idx[moments.event == BEGINS], [0, 1, 2, 3])
    # 12 s are spans of 0.75 s, their middles 0.75 s apart: 16 of them, and the last point.
    own = moments.owner_idx == 1
    assert moments.seconds[own, ENDS].sum() == pytest.approx(12.0 - 0.375, abs=0.05)
    # Who is about to leave may no longer end in sight.
    out = moments.owner_idx == 2
    assert moments.seconds[out, ENDS].sum() < moments.seconds[out, BEGINS].sum() - 1


def test_who_stands_and_a_tracker_that_stops_say_nothing():
    stands = walk((0, 14), (0.3, 14), 10.0)
    crowd = [walk((x, 12), (x, 18), 0.0) for x in (-3.0, -1.0, 0.0, 1.0)]
    around = [walk((-3, 16), (3, 16), since) for since in (-60.0, 90.0)]
    moments = observe_moments([*around, stands, *crowd], LENS, PRIOR)
    assert not (moments.owner_idx == 2).any()
    assert set(moments.owner_idx[moments.event >= 0]) == {0, 1}


def test_nobody_has_no_moments():
    moments = observe_moments([], LENS, PRIOR)
    assert len(moments) == moments.events == moments.owners == 0


def test_some_tracks_are_numbered_anew():
    moments = moments_at([(0, 0), (1, 0), (2, 0)], [1, -1, 0], [0, 1, 0])
    some = moments.of_tracks(np.array([1, 2]))
    assert some.owners == 2
    assert_array_equal(some.owner_idx, [0, 1])
    assert_array_equal(some.event, [-1, 0])
    assert_array_equal(moments.of_owners(np.array([2])).owner_idx, [2])


def test_ratios_are_observed_over_expected():
    # 100 s of walking in one place and 10 ends; 100 s in another, and none.
    places = [(0, 0)] * 11 + [(6, 0)]
    moments = moments_at(places, [-1] + [1] * 10 + [-1], [100.0] + [0.0] * 10 + [100.0])
    counted = count_at(moments, np.array(places, float), np.ones(12, bool), np.ones(12), NODES)
    (counts,) = around(counted, NODES, (GRAIN.smooth_m,))
    doors = door_map_of(counts, NODES, GRAIN)
    # All look as tall: 10 ends in 200 s, begun with 5 more at that very rate.
    assert_allclose(doors.rate[ENDS].max(), 0.05, rtol=1e-6)
    # At a place all within the Gaussian's reach count twice (4 pi sd^2 against 2 pi sd^2).
    here = doors.ratio[40, 40, ENDS]
    assert here == pytest.approx((20 + 0.5) / (10 + 0.5), rel=0.06)
    there = doors.ratio[64, 40, ENDS]
    assert there == pytest.approx(0.5 / (10 + 0.5), rel=0.06)
    assert doors.ratio[40, 70, ENDS] == pytest.approx(1.0, abs=0.02)  # nobody was there
    assert doors.known[40, 40] > 0.95
    assert doors.known[40, 70] < 0.01


def test_who_ends_at_a_door_is_likelier_by_its_ratio():
    doors = door_at(2.0, 1.0)
    at_door, elsewhere = (moments_at([place], [1]) for place in ((2.0, 1.0), (-5.0, 1.0)))
    often = (1 + FEW) / FEW  # one more than the none that are usual in no time: 0.2 anywhere
    apart = door_values(at_door, doors, DOWN[None]) - door_values(elsewhere, doors, DOWN[None])
    assert_allclose(apart, math.log((20.0 + often - 1) / often), rtol=1e-6)


def test_who_passes_a_door_pays_for_it():
    doors = door_at(2.0, 1.0)
    passes = moments_at([(2.0, 1.0)], [-1], [3.0])  # 0.3 events at the usual rate, 6 at the door
    often = FEW / (0.3 + FEW)  # nobody begins or ends: people use all doors less
    assert_allclose(door_values(passes, doors, DOWN[None]), [[-2 * often * 6.0]], rtol=1e-6)


def test_a_tracker_that_loses_people_anywhere_says_less_at_doors():
    doors = door_at(2.0, 1.0)
    often = (20 + FEW) / FEW
    at_door, elsewhere = (
        door_values(moments_at([place] * 20, [1] * 20), doors, DOWN[None])[0, 0]
        for place in ((2.0, 1.0), (-5.0, 1.0))
    )
    assert_allclose(at_door, math.log(20.0 + often - 1), rtol=1e-6)
    assert_allclose(elsewhere, math.log(often), rtol=1e-6)


def test_all_on_the_busiest_door_is_no_better_than_where_they_walk():
    """A candidate that puts all ends and all walking on a door gains nothing by it."""
    doors = door_at(2.0, 1.0)
    count = 200
    event, seconds = [-1] * count + [1] * count, [10.0] * count + [0.0] * count
    at_door = moments_at([(2.0, 1.0)] * 2 * count, event, seconds)
    away = moments_at([(-5.0, 1.0)] * 2 * count, event, seconds)
    gained, lost = (door_values(moments, doors, DOWN[None]).sum() for moments in (at_door, away))
    assert gained < lost


@pytest.mark.parametrize("at", [DOWN, AHEAD])
def test_scores_are_derivatives(at):
    rng = np.random.default_rng(0)
    count = 60
    smooth = door_at(1.0, 4.0, times=6.0)
    rays = np.column_stack([rng.uniform(-0.4, 0.4, (count, 2)), np.ones(count)])
    moments = replace(
        moments_at([(0, 0)] * count, rng.choice([-1, 0, 1], count).tolist()),
        rays=rays,
        seconds=rng.uniform(0, 3, (count, 2)),
    )
    moments = replace(moments, seconds=moments.seconds * (moments.event < 0)[:, None])
    values, scores = door_likelihood(moments, smooth, at)
    assert_allclose(values, door_values(moments, smooth, at[None])[0])
    assert_allclose(anchored_door_scores(moments, smooth, at, at).any(), scores.any())
    for parameter, step in enumerate(1e-6 * np.eye(4)):
        beside = np.array([at + step, at - step])
        ahead, behind = door_values(moments, smooth, beside).sum(axis=1)
        assert scores[:, parameter].sum() == pytest.approx((ahead - behind) / 2e-6, abs=2e-3)


def test_unknown_ground_has_no_part_in_anchored_scores():
    doors = replace(door_at(2.0, 1.0), known=np.zeros(NODES.size))
    moments = moments_at([(2.3, 1.0)], [1])
    assert not anchored_door_scores(moments, doors, DOWN, DOWN).any()
    assert door_likelihood(moments, doors, DOWN)[1].any()


def test_a_turn_is_seen_at_a_door():
    """Ends north of a door, 4 m east of the foot: the camera was turned clockwise, to the east.

    Taken for unturned, its ground is laid out too far anticlockwise, by what is gained by turning.
    """
    doors = door_at(4.0, 0.0)
    moments = moments_at([(4.0, 0.3)] * 8, [1] * 8)
    _, scores = door_likelihood(moments, doors, DOWN)
    assert scores[:, 3].sum() > 0
    turn = 0.3 / 4.0
    there = np.array([DOWN, DOWN + [0, 0, 0, turn]])
    as_it_was, turned = door_values(moments, doors, there).sum(axis=1)
    assert turned > as_it_was


def part_of(rng: np.random.Generator, doors: bool) -> Part:
    """60 people who end at a door, or anywhere, and 20 others."""

    def people(count: int) -> Moments:
        anywhere = rng.uniform(-8, 8, (count, 2))
        ends = rng.normal((3, 3), 0.3, (count, 2)) if doors else rng.uniform(-8, 8, (count, 2))
        both = moments_at(
            np.concatenate([anywhere, ends]).tolist(),
            [-1] * count + [1] * count,
            [10.0] * count + [0.0] * count,
        )
        owners = np.tile(np.arange(count), 2)
        order = np.argsort(owners, kind="stable")
        return replace(
            both,
            rays=both.rays[order],
            owner_idx=owners[order],
            seconds=both.seconds[order],
            event=both.event[order],
            owners=count,
        )

    return Part(
        known=people(60), weights=np.ones(60), asked=people(20), group_idx=np.arange(20),
        nodes=NODES,
    )  # fmt: skip


def test_doors_are_found_where_there_are_some_and_only_there():
    rng = np.random.default_rng(0)
    found = best_door_grain([part_of(rng, doors=True) for _ in range(4)], DOWN)
    assert found is not None
    assert found.smooth_m <= 0.5
    for _ in range(5):
        assert best_door_grain([part_of(rng, doors=False) for _ in range(4)], DOWN) is None
