"""What linking costs where many pieces may go on many: `python -m tests.benchmarks.linking`.

Half of the pieces end where the others begin: all at once, so that each has a thousand rivals, or
a walk each ten seconds, so that each has its own. Exits with 1 beyond the limit.
"""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np

from models.tracks.linking import link_pieces
from tests.models.sites import LENS, PRIOR
from tests.models.tracks.test_linking import START_M, walk

CPU_S = 2.0


def main() -> int:
    """Print the CPU seconds of one linking, when all is compiled."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pieces", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    worst_s = 0.0
    for apart_s in (0.0, 10.0):
        random = np.random.default_rng(asked.seed)
        starts = START_M + random.normal(0.0, 0.4, (asked.pieces // 2, 2))
        pieces = [
            replace(piece, time_s=piece.time_s + apart_s * number)
            for number, start in enumerate(starts)
            for piece in (walk(0, 3, start=start), walk(4, 6, start=start))
        ]
        link_pieces(pieces, LENS, PRIOR)
        begun_s = time.process_time()
        links = link_pieces(pieces, LENS, PRIOR)
        took_s = time.process_time() - begun_s
        worst_s = max(worst_s, took_s)
        said = f"{len(pieces)} pieces, {apart_s:.0f} s apart, {np.sum(links >= 0)} links"
        sys.stdout.write(f"{said}: {took_s:.2f} CPU-s (limit {CPU_S:.0f})\n")
    return int(worst_s > CPU_S)


if __name__ == "__main__":
    sys.exit(main())
