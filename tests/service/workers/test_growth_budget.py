"""Growth of maps at the expense of estimates that wait: a tenth of a worker's time, no more."""

import time
from datetime import UTC, datetime
from functools import partial

import pytest

from tests.service.estimation.test_growth import WANTED, WINDOW, learn_street, map_of
from tests.service.street import PRIOR


@pytest.fixture
def known(learned):
    """A street whose reference is learned, and its map with it."""

    return learned("growth-turns", partial(learn_street, ago_s=20_000.0))


@pytest.mark.nightly
def test_it_leaves_time_for_estimates_that_wait(known, monkeypatch):
    now_s = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    first, context = map_of(known), known.context
    known.keep_to_lanes(PRIOR, 50 + WINDOW)
    with context.store.write() as session:
        context.queue.enqueue_estimate(session, "elsewhere", datetime.now(UTC))
    context.growth_budget.spend(10.0)  # a tenth of the time: the next is in 90 s
    known.look()
    assert map_of(known).learned_at == first.learned_at
    now_s += 91.0
    known.look()
    assert map_of(known).tracks == WANTED + 50


def test_where_no_estimate_waits_it_is_in_nobodys_way(known):
    known.keep_to_lanes(PRIOR, 50 + WINDOW)
    known.context.growth_budget.spend(1000.0)
    known.look()
    assert map_of(known).tracks == WANTED + 50
