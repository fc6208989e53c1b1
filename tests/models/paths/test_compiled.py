"""The compiled loops of the paths, against numbers by hand and differences of values.

Most of the cameras look straight down, with the top of the picture north: a ray (x, y, 1) lands at
h (x, -y), so that a density over the ground is h^2 times as much over the image, and its directions
are those of the ground. Beside it, at (X, Y) camera heights, tilting moves a ground point by
(-X Y, -1 - Y^2).
"""

import importlib
import math
import pkgutil
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import models.paths
from models.compiled import _Compiled
from models.paths.config import DIRECTIONS
from models.paths.coverage import Coverage, anchored_shares, coverage_of, in_view
from models.paths.density_map import PathDensityMap
from models.paths.ground_steps import place_steps
from models.paths.likelihood import PathModel, Walkers
from models.tracks.observations import Rows, Steps
from tests.models.sites import LENS

HEIGHT_M = 5.0
DOWN = np.array([math.pi / 2, 0.0, math.log(HEIGHT_M), 0.0])
AHEAD = np.array([0.5, 0.05, math.log(HEIGHT_M), 0.3])
BY_X, BY_Y = 0.3, -0.2  # of the log density, 1/m
UNSEEN_BY_Y = 0.02


def walkers_between(starts: list, ends: list, owner_idx: list | None = None) -> Walkers:
    """One step a track from ray to ray (x, y), some hours apart."""
    count = len(starts)
    owners = np.arange(count) if owner_idx is None else np.array(owner_idx)
    rays = [np.column_stack([np.array(some, float), np.ones(count)]) for some in (starts, ends)]
    rows = Rows(
        owner_idx=owners,
        linked=np.zeros(count, dtype=bool),
        time_s=7 * 3600.0 * np.arange(count),
        when=np.zeros(count),
        owners=int(owners.max()) + 1,
    )
    steps = Steps(
        start_rays=rays[0],
        end_rays=rays[1],
        noisy_end_rays=rays[1],
        seconds=np.ones(count),
        rows=rows,
    )
    return Walkers(
        steps=steps, weight=np.ones(count), group_idx=np.arange(rows.owners), tracks=rows.owners
    )


def model(density: PathDensityMap, coverage: Coverage) -> PathModel:
    return PathModel(density=density, coverage=coverage, intrinsics=LENS)


def sloping_map(unseen_by_y: float = 0.0, unseen: float = 0.0) -> PathDensityMap:
    """A map of 21 x 21 nodes, 1 m apart, around the foot; all linear, and any way as likely."""
    x, y = np.meshgrid(np.arange(-10.0, 11.0), np.arange(-10.0, 11.0), indexing="ij")
    log_density = np.repeat((BY_X * x + BY_Y * y - 4.0)[None, :, :, None], DIRECTIONS, axis=3)
    return PathDensityMap(
        corner=np.array([-10.0, -10.0]),
        cell_m=1.0,
        log_density=log_density,
        elsewhere=-9.0,
        unseen=unseen + unseen_by_y * y,
        log_level=-4.0,
        log_typical=-3.0,
        people=np.ones((21, 21), dtype=np.float32),
    )


def rough_map(slots: int) -> PathDensityMap:
    rng = np.random.default_rng(0)
    return replace(
        sloping_map(),
        log_density=rng.normal(-4, 1, (slots, 21, 21, DIRECTIONS)),
        unseen=rng.uniform(0, 1, (21, 21)),
    )


def all_in_view(at: tuple[float, float] = (0.0, 0.0), slots: int = 1) -> Coverage:
    """One block, wholly in the picture, with everybody on it."""
    return Coverage(
        places=np.array([at]), shares=np.ones((slots, 1)), unseen=np.zeros(1), block_m=0.5
    )


def test_one_step_by_hand():
    """Ray (0.2, 0.1) to (0.4, 0.1): its middle lands at 5 (0.3, -0.1) m, and it goes east."""
    walkers = walkers_between([(0.2, 0.1)], [(0.4, 0.1)])
    said = model(sloping_map(), all_in_view()).likelihood(walkers, DOWN)
    x, y = 1.5, -0.5
    assert said.value == pytest.approx(BY_X * x + BY_Y * y - 4.0 + 2 * math.log(HEIGHT_M))
    turned = BY_X * y - BY_Y * x  # clockwise; straight down, rolling is the same
    by_hand = [
        # det J changes by -3 Y and |J t|, of a way to the east, by -Y.
        HEIGHT_M * (BY_X * -0.3 * -0.1 + BY_Y * (-1 - 0.1**2)) - 4 * -0.1,
        turned,
        BY_X * x + BY_Y * y + 2,
        turned,
    ]
    assert_allclose(said.scores, [by_hand], rtol=1e-12)


def test_off_the_grid_only_the_change_of_measure_has_a_slope():
    walkers = walkers_between([(2.9, 0.0)], [(3.1, 0.0)])  # 15 m to the east
    said = model(sloping_map(), all_in_view()).likelihood(walkers, DOWN)
    assert said.value == pytest.approx(-9.0 + 2 * math.log(HEIGHT_M))
    assert_allclose(said.scores, [[0, 0, 2, 0]], atol=1e-12)


def test_what_is_not_on_the_ground_costs_and_pulls_nowhere():
    """The second track ends above the horizon, and has no part in its score."""
    walkers = walkers_between([(0.0, 0.1), (0.0, 0.1)], [(0.1, 0.1), (0.0, -2.0)])
    said = model(sloping_map(), all_in_view((0.0, 8.0))).likelihood(walkers, AHEAD)
    assert said.values[1] == -30.0
    assert said.values[0] > -30.0
    assert not said.scores[1].any()
    at_anchor = model(sloping_map(), all_in_view((0.0, 8.0))).scores(walkers, AHEAD, AHEAD)
    assert at_anchor[0].any()
    assert not at_anchor[1].any()
    assert place_steps(walkers.steps, AHEAD).valid.tolist() == [True, False]


def test_a_view_of_hardly_anybody_counts_as_one_of_a_tenth():
    walkers = walkers_between([(0.2, 0.1)], [(0.4, 0.1)])
    seen = model(sloping_map(), all_in_view()).likelihood(walkers, DOWN)
    behind = model(sloping_map(), all_in_view((90.0, 0.0))).likelihood(walkers, DOWN)
    assert behind.value == pytest.approx(seen.value - math.log(0.1))


def test_unseen_ground_is_as_busy_as_is_likeliest():
    walkers = walkers_between([(0.0, 0.0)], [(0.1, 0.0)])
    flow = replace(sloping_map(unseen=1.0), log_density=np.full((1, 21, 21, DIRECTIONS), -6.0))
    coverage = replace(all_in_view(), unseen=np.array([0.5]))
    found = []
    for log_busy in np.linspace(math.log(0.02), math.log(4.0), 9):
        busy = math.exp(log_busy)
        value = math.log(math.exp(-6.0) + busy * math.exp(-3.0)) - math.log(1 + busy * 0.5)
        found.append((value - 0.5 * (log_busy - math.log(0.5)) ** 2, value))
    _, by_hand = max(found)
    assert max(found) not in (found[0], found[-1])
    said = model(flow, coverage).likelihood(walkers, DOWN)
    assert said.value == pytest.approx(by_hand + 2 * math.log(HEIGHT_M))


def test_nobody_says_nothing():
    walkers = walkers_between([(0.0, 0.1)], [(0.1, 0.1)])
    steps = replace(
        walkers.steps,
        start_rays=np.empty((0, 3)),
        end_rays=np.empty((0, 3)),
        rows=replace(walkers.steps.rows, owner_idx=np.empty(0, np.int64), time_s=np.empty(0)),
    )
    nobody = replace(walkers, steps=steps, weight=np.empty(0))
    said = model(sloping_map(), all_in_view()).likelihood(nobody, DOWN)
    assert (said.value, said.values.tolist(), said.scores.tolist()) == (0.0, [0.0], [[0.0] * 4])
    assert not model(sloping_map(), all_in_view()).scores(nobody, DOWN, DOWN).any()


@pytest.mark.parametrize("slots", [1, 4])
def test_scores_of_each_track_are_differences_of_its_value(slots):
    """Of a rough map, partly unseen, by a block that stays in the picture.

    The steps are short: a score is of a step's middle.
    """
    rng = np.random.default_rng(1)
    starts = rng.uniform([-0.5, -0.1], [0.5, 0.8], (60, 2))
    ends = starts + rng.normal(0, 1e-4, (60, 2))
    walkers = walkers_between(starts.tolist(), ends.tolist(), (np.arange(60) // 3).tolist())
    flow, coverage = rough_map(slots), all_in_view((2.5, 8.0), slots)
    said = model(flow, coverage).likelihood(walkers, AHEAD)

    def values(candidate: np.ndarray) -> np.ndarray:
        return model(flow, coverage).track_log_likelihoods(walkers, candidate[None])[0]

    assert_allclose(values(AHEAD), said.values, rtol=1e-13)
    both = model(flow, coverage).track_log_likelihoods(walkers, np.array([AHEAD + 0.01, AHEAD]))
    assert_allclose(both, [values(AHEAD + 0.01), said.values], rtol=1e-13)
    assert coverage.seen_from(LENS, AHEAD)[0] == pytest.approx(1)
    for number, step in enumerate(1e-6 * np.eye(4)):
        slope = (values(AHEAD + step) - values(AHEAD - step)) / 2e-6
        assert_allclose(said.scores[:, number], slope, rtol=1e-4, atol=1e-3)


def test_anchored_scores_count_known_ground_as_seen_from_the_anchor():
    """From the anchor, turned by 90 deg, a step 1.5 m to the east is 1.5 m to the north."""
    walkers = walkers_between([(0.2, 0.0)], [(0.4, 0.0)])
    flow = sloping_map(UNSEEN_BY_Y, 0.2)
    anchor = DOWN - [0, 0, 0, math.pi / 2]
    said = model(sloping_map(), all_in_view()).likelihood(walkers, DOWN)
    anchored = model(flow, all_in_view()).scores(walkers, DOWN, anchor)
    here = model(flow, all_in_view()).scores(walkers, DOWN, DOWN)
    share = anchored_shares(
        all_in_view(), flow, LENS, DOWN + 0.01 * np.concatenate([np.eye(4), -np.eye(4)]), DOWN
    )
    pull = (np.log(share[:4, 0]) - np.log(share[4:, 0])) / 0.02
    assert_allclose(here, 0.8 * (said.scores - pull), rtol=1e-9)
    assert_allclose(anchored[0, 2], (0.8 - UNSEEN_BY_Y * 1.5) * said.scores[0, 2], rtol=1e-9)


def test_anchored_shares_go_by_the_part_of_the_picture():
    """A camera turned to the east has at its right what is south; so the anchor has it east."""
    flow = sloping_map(UNSEEN_BY_Y, 0.3)
    east = DOWN + [0, 0, 0, math.pi / 2]
    coverage = all_in_view((1.0, 0.0))  # ahead of it: to the north, as the anchor sees it
    assert_allclose(
        anchored_shares(coverage, flow, LENS, np.array([[DOWN, east]]), DOWN),
        [[[1 - 0.3], [1 - 0.3 - UNSEEN_BY_Y * 1.0]]],
    )
    assert anchored_shares(coverage, flow, LENS, east, DOWN).shape == (1,)


def test_a_block_at_the_edge_is_in_view_by_halves():
    """Straight down from 5 m, LENS sees 5 / 1100 m a pixel: 2.907 m to the west, 1.634 north."""
    west, north = -HEIGHT_M * LENS.cx / LENS.fx, HEIGHT_M * LENS.cy / LENS.fy
    east = HEIGHT_M * (LENS.width - LENS.cx) / LENS.fx
    places = np.array(
        [[0, 0], [west, 0], [west, north], [east, 0], [west + 0.1, 0], [west - 0.3, 0]]
    )
    parts = in_view(LENS, DOWN, places, 0.5)
    assert_allclose(parts, [1, 0.5, 0.25, 0.5, 0.7, 0], atol=1e-12)
    up = DOWN * [-1, 1, 1, 1]
    assert not in_view(LENS, up, places, 0.5).any()
    many = in_view(LENS, np.array([[DOWN, up, DOWN]] * 2), places, 0.5)
    assert_allclose(many, np.array([[parts, 0 * parts, parts]] * 2))


def test_one_kind_of_arguments_is_compiled_whoever_calls():
    """Each kind takes seconds; arrays of other callers lie otherwise in memory."""
    walkers = walkers_between([(0.0, 0.1), (0.1, 0.2)], [(0.1, 0.1), (0.0, 0.3)])
    every_other = replace(
        walkers,
        steps=replace(
            walkers.steps,
            start_rays=np.asfortranarray(walkers.steps.start_rays),
            end_rays=np.repeat(walkers.steps.end_rays, 2, axis=0)[::2],
        ),
    )
    for slots in (1, 4):
        flow = rough_map(slots)
        turned = replace(flow, unseen=np.asfortranarray(flow.unseen), cell_m=1, elsewhere=-9)
        for some, asked in ((flow, walkers), (turned, every_other)):
            coverage = coverage_of(some)
            model(some, coverage).likelihood(asked, AHEAD)
            model(some, coverage).track_log_likelihoods(asked, np.array([AHEAD, DOWN]))
            model(some, coverage).track_log_likelihoods(
                asked, np.array([AHEAD, DOWN, DOWN]).T[:, :2].T
            )
            place_steps(asked.steps, AHEAD)
            model(some, coverage).scores(asked, AHEAD, DOWN)
            in_view(LENS, np.array([AHEAD, DOWN]), coverage.places, 1)
            some.log_density_at(np.zeros((2, 2)).T, np.zeros(4)[::2], np.zeros(2, np.int64))
            some.unseen_at(np.zeros((3, 2)))
    rooms = [
        importlib.import_module(f"models.paths.{part.name}")
        for part in pkgutil.iter_modules(models.paths.__path__)
    ]
    loops = {loop for room in rooms for loop in vars(room).values() if isinstance(loop, _Compiled)}
    assert len(loops) > 15
    for loop in loops:
        assert len(loop.signatures) <= 1, (loop, loop.signatures)  # none: it came with another
