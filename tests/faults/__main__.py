"""`python -m tests.faults`: see `--help`."""

import argparse
import os
import shutil
import signal
import subprocess
import sys

from tests.faults.faults import FAULTS
from tests.faults.run import Plan, run

_UNSHARE = ("unshare", "--mount", "--propagation", "private")


def main() -> int:
    """Read the words of the command, go into a mount namespace of its own, run."""
    names = [fault.name for fault in FAULTS] + ["corrupt"]
    words = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    words.add_argument("--kills", type=int, default=20, help="kill -9 of the API and of workers")
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--cameras", type=int, default=3)
    words.add_argument("--trackers", type=int, default=4)
    words.add_argument("--trainings", type=int, default=1, help="cameras whose model is trained")
    words.add_argument("--workers", type=int, default=2, help="of each machine")
    words.add_argument(
        "--machines", type=int, default=1, help="more than one share a PostgreSQL server"
    )
    words.add_argument("--pause-s", type=float, default=0.4, help="of a tracker between posts")
    words.add_argument("--only", nargs="*", choices=names, default=[], help="faults beside kills")
    words.add_argument("--keep", action="store_true", help="keep the folder with data and log")
    told = words.parse_args()
    _go_private()
    # An end from outside still ends all that was started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    return run(Plan(**vars(told)))


def _go_private() -> None:
    """Start over in a namespace where mounts are nobody else's, if that is possible."""
    if "FAULTS_MOUNTS" in os.environ or shutil.which("unshare") is None:
        return
    if subprocess.run([*_UNSHARE, "true"], capture_output=True, check=False).returncode:
        return
    again = [*_UNSHARE, sys.executable, "-m", "tests.faults", *sys.argv[1:]]
    os.execvpe(again[0], again, os.environ | {"FAULTS_MOUNTS": "private"})


if __name__ == "__main__":
    sys.exit(main())
