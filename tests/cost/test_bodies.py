"""No body that hypothesis draws costs more memory than a small multiple of its size.

A short version; 20,000 of up to 32 MiB, and the worst ten: `python -m tests.cost --windows 0`.
"""

import sys

import pytest
from hypothesis import HealthCheck, given, settings

from tests.cost.bodies import MB, bodies, read_cost, words_of

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the peak of memory")


@pytest.mark.slow
@settings(max_examples=150, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(bodies(4 * MB))
def test_no_body_costs_more_than_it_is_worth(drawn):
    cost = read_cost(drawn)
    assert not cost.too_large, words_of(cost)
