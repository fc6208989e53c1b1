"""How long the estimators take on one core: the joint estimate, the flow map and the fused pose.

    python -m tests.benchmarks.estimators

A simulated site; maps of 200 and of 2,000 tracks, a knock, and 400 tracks after it: with and
without boxes for the joint estimate, with a pan for the fused pose. Times differ between machines,
so those of maps are also told as multiples of one joint estimate in the same run.
"""

import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from models.paths.reference import learn_paths
from models.pose.change_point import find_change
from models.pose.fusion import fused_estimate
from models.pose.site import CameraSite
from models.simulation.walkers import WalkConfig
from models.tracks.trajectory import by_end
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from tests.models.sites import KNOCKED, LENS, PRIOR, seen, tracks_of

MAPS, TRACKS, RUNS = (200, 2000), 400, 7
PANNED = replace(KNOCKED, heading_rad=PRIOR.heading_rad + 0.1)
LIMIT_S = 1.0


def main() -> int:
    """Measure; 1 where a median estimate is over the limit."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    console = Console(width=110)
    console.print(f"{_processor()}, one core, {platform.python_version()}; medians of {RUNS}")
    took_s = [_joint(form, console) for form in ("points", "boxes")]
    took_s.append(_fused(console))
    return 1 if max(took_s) >= LIMIT_S else 0


def _joint(form: str, console: Console) -> float:
    known, after = tracks_of(0, (PRIOR, min(MAPS)), (KNOCKED, TRACKS), boxes=form == "boxes")
    started = time.perf_counter()
    reference = learn_speed_reference(seen(known), PRIOR, WalkConfig(), 0)
    learned_s = time.perf_counter() - started
    after = by_end(after)
    estimate_s = _median_s(lambda: joint_estimate(seen(after), PRIOR, reference))
    change_s = _median_s(lambda: find_change(seen(after), PRIOR, reference))
    console.print(
        f"{form}: joint estimate of {TRACKS} tracks {estimate_s:.2f} s; looking for a change "
        f"{change_s:.2f} s; reference {learned_s:.2f} s"
    )
    return estimate_s


def _fused(console: Console) -> float:
    known, after = tracks_of(0, (PRIOR, max(MAPS)), (PANNED, TRACKS))
    tracks = seen(after)
    speeds = learn_speed_reference(seen(known[: min(MAPS)]), PRIOR, WalkConfig(), 0)
    site = CameraSite(intrinsics=LENS, prior=PRIOR, speed_reference=speeds)
    joint = joint_estimate(tracks, PRIOR, speeds)
    joint_s = _median_s(lambda: joint_estimate(tracks, PRIOR, speeds))
    console.print(f"joint estimate of {TRACKS} tracks, with a pan: {joint_s:.2f} s")
    slowest_s = 0.0
    for size in MAPS:
        reference_tracks = seen(known[:size])
        flow = learn_paths(reference_tracks, LENS, PRIOR, 0)
        assert flow is not None
        learned_s = _median_s(lambda of=reference_tracks: learn_paths(of, LENS, PRIOR, 0))
        fused_s = _median_s(
            lambda flow=flow: fused_estimate(tracks, replace(site, paths=flow), joint)
        )  # fmt: skip
        console.print(
            f"map of {size} tracks: learned in {learned_s:.2f} s ({learned_s / joint_s:.1f} joint "
            f"estimates); {TRACKS} tracks registered in {fused_s:.2f} s ({fused_s / joint_s:.1f})"
        )
        slowest_s = max(slowest_s, fused_s)
    return slowest_s


def _median_s(work: Callable[[], object]) -> float:
    took_s = []
    for _ in range(RUNS):
        started = time.perf_counter()
        work()
        took_s.append(time.perf_counter() - started)
    return statistics.median(took_s)


def _processor() -> str:
    """The name of the processor, as the kernel has it."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


if __name__ == "__main__":
    sys.exit(main())
