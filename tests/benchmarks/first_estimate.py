"""How soon a camera that was never seen has an estimate, and how good that is.

    python -m tests.benchmarks.first_estimate [--cameras 12]

Cameras at simulated streets, each some degrees off its prior pose, before a service as it is out of
the box, trainings and all. Thirty people are posted one by one; the clock runs from the last of
them until the pose shows an estimate of all thirty. Then come 370 more, while the reference still
learns: errors of the thirty's estimate over those of the four hundred's, in the root mean square.
"""

import argparse
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from models.geometry.pose import CameraPose
from models.simulation.poses import PoseOffset
from models.tracks.trajectory import Trajectory, by_end
from service.commands.migrate import migrate
from service.settings import Settings
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.benchmarks.parts.cloned import APART_S, as_posted
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for
from tests.service.street import LENS, PRIOR

FIRST, FULL = 30, 400
LIMIT_S, LIMIT_RATIO = 10.0, 1.2
_REFERENCE = 500  # is still learned when all have been
_ANGLE_RAD, _LOG_HEIGHT = math.radians(5), 0.1  # a prior pose is off by up to so much
_SOME = 0.9  # pieces of others' walks are not counted


def main() -> int:
    """Measure; 1 where the first estimate comes too late, or is much worse than the full one."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--cameras", type=int, default=12)
    cameras: int = ask.parse_args().cameras
    with tempfile.TemporaryDirectory(prefix="surefoot-first-") as folder:
        settings = Settings(data_dir=Path(folder) / "data", port=free_port())
        migrate(settings)
        service = RunningService(settings, forked=False)
        service.start()
        try:
            wait_for(service.ready)
            found = [_measure(service, seed) for seed in range(cameras)]
        finally:
            service.stop()
    took_s = [each[0] for each in found]
    first, full = (np.sqrt(np.nanmean([each[at] ** 2 for each in found], axis=0)) for at in (1, 2))
    ratios = first / full
    console = Console(width=110)
    console.print(
        f"{cameras} cameras: an estimate of {FIRST} people after {np.median(took_s):.1f} s "
        f"(at the most {max(took_s):.1f})"
    )
    for name, a, b, ratio in zip(("tilt", "roll", "height"), first, full, ratios, strict=True):
        unit = "%" if name == "height" else "deg"
        console.print(f"{name}: {a:.2f} {unit} off, of {FULL} people {b:.2f}: {ratio:.1f} times")
    return 1 if max(took_s) > LIMIT_S or ratios.max() > LIMIT_RATIO else 0


def _measure(service: RunningService, seed: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Seconds to the first estimate, and errors (3,) of it and of the full one."""
    rng = np.random.default_rng(seed)
    tilt, roll = rng.uniform(-_ANGLE_RAD, _ANGLE_RAD, 2)
    log_height = rng.uniform(-_LOG_HEIGHT, _LOG_HEIGHT)
    knock = PoseOffset(tilt_rad=tilt, roll_rad=roll, log_height=log_height)
    truth, config = knock.apply(PRIOR), SiteConfig()
    walks = by_end(walk_site(LENS, truth, draw_lanes(LENS, truth, config, rng), config, FULL, rng))
    camera_id = f"new-{seed}"
    body = {**CAMERA, "id": camera_id, "reference_tracks": _REFERENCE}
    service.http.post("/cameras", json=body).raise_for_status()
    began_s = time.time() - APART_S * len(walks)
    for number, walk in enumerate(walks[:FIRST]):
        _post(service, camera_id, [(number, walk)], began_s)
    since_s = time.monotonic()
    first = wait_for(lambda: _estimate(service, camera_id, FIRST), every_s=0.05)
    took_s = time.monotonic() - since_s
    _post(service, camera_id, list(enumerate(walks))[FIRST:], began_s)
    full = wait_for(lambda: _estimate(service, camera_id, round(_SOME * FULL)), every_s=0.2)
    return took_s, _errors(first, truth), _errors(full, truth)


def _post(
    service: RunningService, camera_id: str, some: list[tuple[int, Trajectory]], began_s: float
) -> None:
    tracks = [as_posted(walk, str(n), began_s + APART_S * (n + 1)) for n, walk in some]
    body = {"source": "a", "tracks": tracks}
    service.http.post(f"/cameras/{camera_id}/tracks", json=body).raise_for_status()


def _estimate(service: RunningService, camera_id: str, tracks: int) -> dict[str, Any] | None:
    """The estimate that is shown while a camera learns, once it is of so many tracks."""
    pose = service.http.get(f"/cameras/{camera_id}/pose").json()
    shown = pose["estimates"].get("joint")
    return shown if shown and shown["tracks"] >= tracks else None


def _errors(shown: dict[str, Any], truth: CameraPose) -> np.ndarray:
    """Tilt and roll in degrees, height in percent (3,); NaN where it is not told."""

    def off(name: str, true: float) -> float:
        return math.nan if shown.get(name) is None else float(shown[name]) - true

    return np.array(
        [
            off("tilt_deg", math.degrees(truth.tilt_rad)),
            off("roll_deg", math.degrees(truth.roll_rad)),
            100 * off("height_m", truth.height_m) / truth.height_m,
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
