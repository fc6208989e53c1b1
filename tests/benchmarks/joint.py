"""How long the joint estimate of 400 tracks takes, on one core.

    python -m tests.benchmarks.joint

A simulated site; a reference of 200 tracks, a knock, 400 tracks after it.
"""

import os
import statistics
import time
from collections.abc import Callable

from rich.console import Console

from models.drift.change_point import find_change
from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.reference import learn_speed_reference
from models.simulation.walkers import WalkConfig
from models.trajectory import by_end
from tests.models.sites import KNOCKED, PRIOR, seen, tracks_of

TRACKS, RUNS = 400, 7
LIMIT_S = 1.0


def main() -> None:
    """Measure with and without boxes; fails where the median estimate is over the limit."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    for form in ("points", "boxes"):
        estimate_s = _measure(form)
        assert estimate_s < LIMIT_S


def _measure(form: str) -> float:
    known, after = tracks_of(0, (PRIOR, 200), (KNOCKED, TRACKS), boxes=form == "boxes")
    started = time.perf_counter()
    reference = learn_speed_reference(seen(known), PRIOR, WalkConfig(), 0)
    learned_s = time.perf_counter() - started
    after = by_end(after)
    estimate_s = median_s(lambda: joint_estimate(seen(after), PRIOR, reference))
    change_s = median_s(lambda: find_change(seen(after), PRIOR, reference))
    Console().print(
        f"{form}: estimate {estimate_s:.2f} s, {estimate_s / LIMIT_S:.2f} of the limit of "
        f"{LIMIT_S:g} s; looking for a change {change_s:.2f} s; reference {learned_s:.2f} s"
    )
    return estimate_s


def median_s(work: Callable[[], object]) -> float:
    """How long some work takes, of several runs."""
    took_s = []
    for _ in range(RUNS):
        started = time.perf_counter()
        work()
        took_s.append(time.perf_counter() - started)
    return statistics.median(took_s)


if __name__ == "__main__":
    main()
