"""Grains that were chosen are kept while the same people walk, and chosen anew when others may."""

from dataclasses import replace

import numpy as np
import pytest

from models.paths import folds
from models.paths.folds import fold_maps
from models.paths.reference import candidate_of, learn_flow
from models.paths.serialization import flow_from_bytes, flow_to_bytes
from models.pose import learn_site
from models.tracks.trajectory import by_end
from tests.models.sites import LENS, PRIOR, seen, tracks_of

AT = candidate_of(PRIOR)
HOUR_S = 3600.0


@pytest.fixture(scope="module")
def known():
    (tracks,) = tracks_of(3, (PRIOR, 60))
    return seen(by_end(tracks))


@pytest.fixture(scope="module")
def chosen(known):
    return fold_maps(known, LENS, AT, 0).grains


@pytest.fixture
def asked(monkeypatch):
    """How often which grain is best was asked."""
    times = []
    best = folds.best_grain

    def noted(*arguments):
        times.append(1)
        return best(*arguments)

    monkeypatch.setattr(folds, "best_grain", noted)
    return times


def test_a_map_of_kept_grains_is_that_of_chosen_ones(known, chosen, asked):
    first = learn_flow(known, LENS, PRIOR, 0)
    assert len(asked) == 1
    again = learn_site(known, LENS, PRIOR, chart=False, grains=first.grains)
    assert len(asked) == 1
    assert flow_to_bytes(again.flow) == flow_to_bytes(first)
    assert again.flow.grains == chosen


def test_bytes_keep_them_and_those_without_have_none(known, chosen):
    learned = learn_flow(known, LENS, PRIOR, 0)
    assert flow_from_bytes(flow_to_bytes(learned)).grains == chosen
    before = flow_to_bytes(replace(learned, grains=None))
    assert flow_from_bytes(before).grains is None


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
    found = fold_maps(known, LENS, AT, 0, grains=before)
    assert bool(asked) == anew
    assert found.grains == (chosen if anew else before)


def test_walkers_without_moments_have_no_doors_whatever_was_kept(known, chosen):
    assert chosen.doors is None or known.moments is not None
    bare = replace(known, moments=None)
    with_doors = replace(chosen, doors=folds.DoorGrain(smooth_m=0.5, alike=False))
    found = fold_maps(bare, LENS, AT, 0, grains=with_doors)
    assert all(fold.site.doors is None for fold in found.each)
    assert np.isfinite(found.each[0].site.flow.log_density).all()
