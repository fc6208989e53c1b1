"""Chosen bandwidths are kept while the same people walk, and chosen anew when others may."""

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.paths import folds
from models.paths.folds import fold_maps
from models.paths.reference import learn_paths, paths_from_bytes, paths_to_bytes
from models.pose import learn_site
from models.tracks.trajectory import Trajectory, by_end
from tests.models.sites import LENS, PRIOR, seen, tracks_of

AT = array_of(PRIOR)
HOUR_S = 3600.0


@pytest.fixture(scope="module")
def known():
    (tracks,) = tracks_of(3, (PRIOR, 60))
    return seen(by_end(tracks))


@pytest.fixture(scope="module")
def chosen(known):
    return fold_maps(known, LENS, AT, 0).chosen


@pytest.fixture
def asked(monkeypatch):
    """How often which bandwidths are best was asked."""
    times = []
    best = folds.best_bandwidths

    def noted(*arguments):
        times.append(1)
        return best(*arguments)

    monkeypatch.setattr(folds, "best_bandwidths", noted)
    return times


def test_a_map_of_kept_bandwidths_is_that_of_chosen_ones(known, chosen, asked):
    first = learn_paths(known, LENS, PRIOR, 0)
    assert len(asked) == 1
    again = learn_site(known, LENS, PRIOR, chart=False, chosen=first.bandwidths)
    assert len(asked) == 1
    assert paths_to_bytes(again.paths) == paths_to_bytes(first)
    assert again.paths.bandwidths == chosen


def test_bytes_keep_them(known, chosen):
    learned = learn_paths(known, LENS, PRIOR, 0)
    assert paths_from_bytes(paths_to_bytes(learned)).bandwidths == chosen


@pytest.mark.parametrize(
    ("later_s", "learned_of", "anew"),
    [
        pytest.param(HOUR_S, 40, False, id="an hour later"),
        pytest.param(7 * HOUR_S, 40, True, id="another part of the day"),
        pytest.param(-7 * HOUR_S, 40, True, id="a clock that was set back"),
        pytest.param(HOUR_S, 30, True, id="twice as many people"),
    ],
)
def test_they_are_chosen_anew_when_people_may_walk_elsewhere(
    known, chosen, asked, later_s, learned_of, anew
):
    assert known.tracks == 60
    before = replace(chosen, tracks=learned_of, to_s=float(known.ended_s.max()) - later_s)
    found = fold_maps(known, LENS, AT, 0, chosen=before)
    assert bool(asked) == anew
    assert found.chosen == (chosen if anew else before)


def test_people_of_whom_none_tells_where_the_others_are_leave_no_paths():
    """All scores were zero, no Cholesky factor was found, and the camera's look failed."""
    rng = np.random.default_rng(0)
    offset_s = np.array([0.0, 1e-3, 2e-3, 1.0, 2.0])
    standing = []
    for begin_s in np.sort(rng.uniform(0, HOUR_S, 60)):
        uv = np.array([640.0, 504.0]) + rng.normal(0, 1, 2) + rng.normal(0, 0.5, (5, 2))
        uv[0, 1] -= 40.0
        standing.append(Trajectory(time_s=begin_s + offset_s, uv=uv))
    observed = seen(standing)
    assert learn_paths(observed, LENS, PRIOR, 0) is None
    assert learn_site(observed, LENS, PRIOR, chart=False).paths is None
