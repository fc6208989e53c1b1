"""A short fault run; `python -m tests.faults --kills 200` is the long one."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.nightly
@pytest.mark.slow
def test_kills_and_a_full_disk_lose_nothing_and_leave_nothing_waiting():
    """Its own process, since it mounts a disk where it may; that comes with its namespace."""
    words = ["--kills", "6", "--only", "full disk", "--trainings", "0", "--pause-s", "0.2"]
    run = subprocess.run(
        [sys.executable, "-m", "tests.faults", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
        cwd=Path(__file__).parents[2],
    )
    assert run.returncode == 0, run.stdout + run.stderr
    counts = {}
    for line in run.stdout.splitlines():
        count, _, name = line.strip().partition("  ")
        if count.isdigit():
            counts[name] = int(count)
    assert counts["tracks acknowledged"] > 20
    assert counts["messages received"] > 4
    assert counts["kill -9 api"] + counts["kill -9 worker"] == 6
