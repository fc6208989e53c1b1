"""Over simulated sites: the intervals cover, errors near their bound fall as they should.

Ten sites; `python -m tests.benchmarks.joint_coverage` has the figures of as many as are asked.
"""

import pytest

from tests.benchmarks.joint_coverage import coverage_of

SITES = 10


@pytest.mark.slow
def test_intervals_cover_and_errors_fall_as_their_bound_does():
    found = coverage_of(SITES)
    # 90 % is stated; 60 intervals of three times 10 sites that share much.
    assert 0.8 < found.covered.mean() < 0.99
    assert (found.many_rms / found.few_rms < 0.8).all()  # a half, were the site known exactly
    # Normal speeds under a Student-t scatter a fifth more than its curvature says.
    assert (found.many_rms / found.bound_rms < 1.8).all()
