"""A worker whose looks find what was made up: `python -m tests.benchmarks.city.stub NAME`.

All else of a look is the service's own: the job, what is read, what is judged, stored and told.
"""

import math
import sys
from dataclasses import replace
from zlib import crc32

from service.estimation.compute import ComputedEstimate
from service.estimation.evidence import Evidence
from service.workers import estimate
from tests.service.bench import made_up

MOVED = 500  # of so many cameras one has moved
_TURN_RAD = math.radians(6)


def found(evidence: Evidence, seed: int) -> ComputedEstimate:
    """The prior pose; of one in five hundred, one that is turned."""
    pose = evidence.prior
    if has_moved(evidence.camera_id):
        pose = replace(pose, tilt_rad=pose.tilt_rad + _TURN_RAD)
    return made_up(evidence, pose)


def has_moved(camera_id: str) -> bool:
    """Whether a camera is one of those that have moved."""
    return crc32(camera_id.encode()) % MOVED == 0


if __name__ == "__main__":
    estimate.compute_estimate = found
    sys.argv = ["surefoot", "worker", "--name", sys.argv[1]]
    from service.cli import main

    main()
