"""All benchmarks that end within minutes, one after the other: `python -m tests.benchmarks`.

    python -m tests.benchmarks [--only runs,requests] [--output benchmarks.json]

Each is a process of its own and can be run by itself (`python -m tests.benchmarks.runs`). What
they say is printed as it comes; the file has it all, with the machine. Exits with 1 where one is
beyond its limits.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

# What each is asked beside its name: here all are to end within some minutes.
BENCHMARKS: dict[str, tuple[str, ...]] = {
    "runs": (),
    "estimators": (),
    "first_estimate": (),
    "trainings": ("--only", "default"),
    "requests": ("--json",),
    "ground": (),
    "linking": (),
    "poison": (),
    "strangers": (),
    "silent_cameras": (),
    "start": (),
    "idle": ("--cameras", "500", "--minutes", "1"),
    "fleet": (),
    "cameras": ("--cameras", "100", "--minutes", "3"),
    "load": ("--minutes", "2"),
}


def run(name: str) -> dict[str, Any]:
    """One benchmark: what it said, how it ended, and how long it and its children computed."""
    begun_s, before = time.monotonic(), os.times()
    process = subprocess.Popen(
        [sys.executable, "-m", f"tests.benchmarks.{name}", *BENCHMARKS[name]],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        sys.stdout.write(line)
        said.append(line.rstrip("\n"))
    code, after = process.wait(), os.times()
    cpu_s = after.children_user + after.children_system
    cpu_s -= before.children_user + before.children_system
    return {
        "within_limits": code == 0,
        "wall_s": round(time.monotonic() - begun_s, 1),
        "cpu_s": round(cpu_s, 1),
        "said": _read("\n".join(said)),
    }


def _read(said: str) -> Any:
    try:
        return json.loads(said)
    except ValueError:
        return said.splitlines()


def main() -> int:
    """Run those that are asked for; print a table, and write a file if there is to be one."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--only", default=",".join(BENCHMARKS), help="names, with commas")
    asked.add_argument("--output", type=Path)
    wanted = asked.parse_args()
    names = wanted.only.split(",")
    unknown = sorted(set(names) - set(BENCHMARKS))
    if unknown:
        asked.error(f"--only: {', '.join(BENCHMARKS)} are known, got {', '.join(unknown)}")
    found = {}
    for name in names:
        sys.stdout.write(f"== {name}\n")
        sys.stdout.flush()
        found[name] = run(name)
    table = Table("benchmark", "within its limits", "wall s", "CPU s")
    for name, result in found.items():
        limits = "yes" if result["within_limits"] else "no"
        table.add_row(name, limits, f"{result['wall_s']:.0f}", f"{result['cpu_s']:.0f}")
    Console().print(table)
    if wanted.output is not None:
        machine = {"machine": platform.machine(), "cores": os.cpu_count()}
        wanted.output.write_text(json.dumps({**machine, "benchmarks": found}, indent=1) + "\n")
    return 0 if all(result["within_limits"] for result in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
