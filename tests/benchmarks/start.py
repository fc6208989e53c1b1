"""What starting costs: `python -m tests.benchmarks.start [--times 5] [--rival FOLDER]`.

CPU and time until `surefoot serve` answers /healthz and its worker is there, and CPU of commands
that end at once, which is what they import: `--help`, a `serve` and a `worker` that are refused. A
rival is another checkout, migrated and started by its own code, in turns with this one. Medians, as
JSON.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import psutil

from tests.running import free_port, wait_for

_HERE = Path(__file__).parents[2]
_EVERY_S = 0.005


def environment(checkout: Path, **settings: object) -> dict[str, str]:
    """What a command of a checkout is run with."""
    ours = {f"SUREFOOT_{name.upper()}": str(value) for name, value in settings.items()}
    return {**os.environ, "PYTHONPATH": str(checkout), **ours}


def serve(checkout: Path) -> dict[str, float]:
    """A start over a database that needs no migration, with one worker."""
    with tempfile.TemporaryDirectory(prefix="surefoot-start-") as folder:
        known = environment(checkout, data_dir=f"{folder}/data", port=free_port(), workers=1)
        words = [sys.executable, "-m", "service.cli"]
        subprocess.run(
            [*words, "migrate"], env=known, cwd=checkout, check=True, capture_output=True
        )
        url = f"http://127.0.0.1:{known['SUREFOOT_PORT']}"
        begun_s = time.monotonic()
        with (
            Path(folder, "log").open("w") as log,
            subprocess.Popen([*words, "serve"], env=known, cwd=checkout, stderr=log) as process,
            httpx.Client(base_url=url, timeout=30) as client,
        ):
            try:
                wait_for(lambda: says_ok(client, "/healthz"), every_s=_EVERY_S)
                answered_s = time.monotonic() - begun_s
                times = psutil.Process(process.pid).cpu_times()
                wait_for(lambda: says_ok(client, "/readyz"), every_s=_EVERY_S)
                ready_s = time.monotonic() - begun_s
                rss_mb = psutil.Process(process.pid).memory_info().rss / 2**20
            finally:
                process.terminate()
    return {
        "answers_after_s": answered_s,
        "answers_after_cpu_s": times.user + times.system,
        "ready_after_s": ready_s,
        "serve_rss_mb": rss_mb,
    }


def says_ok(client: httpx.Client, path: str) -> bool:
    """Whether a path is answered 200."""
    try:
        return client.get(path).status_code == 200
    except httpx.TransportError:
        return False


def cpu_s(checkout: Path, *words: str, **settings: object) -> float:
    """CPU of a python command, from its start to its end."""
    before = os.times()
    command, known = [sys.executable, *words], environment(checkout, **settings)
    subprocess.run(command, env=known, cwd=checkout, check=False, capture_output=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def command(checkout: Path, *words: str, **settings: object) -> float:
    """CPU of a command that ends at once."""
    return cpu_s(checkout, "-m", "service.cli", *words, port=free_port(), **settings)


MEASURES: dict[str, Callable[[Path], float]] = {
    "help_cpu_s": lambda checkout: command(checkout, "--help"),
    "wrong_setting_cpu_s": lambda checkout: command(checkout, "serve", workers="some"),
    # The data directory is a file.
    "refused_cpu_s": lambda checkout: command(checkout, "serve", data_dir=__file__),
    "worker_refused_cpu_s": lambda checkout: command(checkout, "worker", data_dir=__file__),
}


def main() -> None:
    """Measure each as often as is asked for, and print medians."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--times", type=int, default=5)
    asked.add_argument("--rival", type=Path)
    wanted = asked.parse_args()
    checkouts = [_HERE] if wanted.rival is None else [_HERE, wanted.rival.resolve()]
    found: dict[str, dict[str, list[float]]] = {str(checkout): {} for checkout in checkouts}
    for time_no in range(wanted.times + 1):
        for checkout in checkouts:
            values = serve(checkout) | {name: ask(checkout) for name, ask in MEASURES.items()}
            for name, value in values.items():
                if time_no:  # the first one compiles and warms the disk
                    found[str(checkout)].setdefault(name, []).append(value)
    medians = {
        checkout: {name: round(statistics.median(values), 3) for name, values in each.items()}
        for checkout, each in found.items()
    }
    json.dump(medians, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
