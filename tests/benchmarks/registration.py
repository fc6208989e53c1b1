"""How long the fused pose of 400 tracks and learning a flow map take, on one core.

    python -m tests.benchmarks.registration

A simulated site; maps of 200 and of 2,000 tracks, a knock with a pan, 400 tracks after it. Times
differ between machines, so each is also told as a multiple of one joint estimate in the same run.
"""

import os
import platform
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.reference import learn_speed_reference
from models.flow.fusion import fused_estimate
from models.flow.reference import learn_flow
from models.simulation.walkers import WalkConfig
from tests.benchmarks.joint import RUNS, median_s
from tests.models.sites import KNOCKED, LENS, PRIOR, seen, tracks_of

MAPS, TRACKS = (200, 2000), 400
PANNED = replace(KNOCKED, heading_rad=PRIOR.heading_rad + 0.1)
LIMIT_S = 1.0


def main() -> None:
    """Measure; fails where the median registration is over the limit."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    console = Console(width=110)
    console.print(f"{_processor()}, one core, {platform.python_version()}; medians of {RUNS}")
    known, after = tracks_of(0, (PRIOR, max(MAPS)), (PANNED, TRACKS))
    tracks = seen(after)
    speeds = learn_speed_reference(seen(known[: min(MAPS)]), PRIOR, WalkConfig(), 0)
    joint = joint_estimate(tracks, PRIOR, speeds)
    joint_s = median_s(lambda: joint_estimate(tracks, PRIOR, speeds))
    console.print(f"joint estimate of {TRACKS} tracks: {joint_s:.2f} s")
    slowest_s = 0.0
    for size in MAPS:
        reference_tracks = seen(known[:size])
        flow = learn_flow(reference_tracks, LENS, PRIOR, 0)
        assert flow is not None
        learned_s = median_s(lambda of=reference_tracks: learn_flow(of, LENS, PRIOR, 0))
        fused_s = median_s(
            lambda flow=flow: fused_estimate(tracks, LENS, PRIOR, joint, speeds, flow)
        )  # fmt: skip
        console.print(
            f"map of {size} tracks: learned in {learned_s:.2f} s ({learned_s / joint_s:.1f} joint "
            f"estimates); {TRACKS} tracks registered in {fused_s:.2f} s ({fused_s / joint_s:.1f})"
        )
        slowest_s = max(slowest_s, fused_s)
    assert slowest_s < LIMIT_S


def _processor() -> str:
    """The name of the processor, as the kernel has it."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


if __name__ == "__main__":
    main()
