"""What studies share: results as they end, out of real processes, and JSON that says where."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from functools import partial
from io import StringIO

import psutil
import pytest
from rich.console import Console

from studies.runs import as_they_end, process_pool, with_bar, write_results
from tests.conftest import ROOT


def test_results_come_as_tasks_end_and_the_bar_counts_cases():
    shown = StringIO()
    with process_pool(1) as pool:
        tasks = [partial(pow, 3, 2), partial(pow, 2, 5)]
        assert sorted(as_they_end(pool, tasks)) == [(0, 9), (1, 32)]
        console = Console(file=shown, force_terminal=True, width=80)
        assert sorted(with_bar(pool, tasks, console, cases=[4, 3])) == [9, 32]
    assert "7/7" in shown.getvalue()


def test_a_tick_comes_while_nothing_ends_and_a_failure_is_raised():
    ticks = []
    with process_pool(1) as pool:
        assert list(as_they_end(pool, [partial(time.sleep, 1.5)], lambda: ticks.append(1)))
        assert ticks
        with pytest.raises(ValueError, match="math domain error|nonnegative"):
            list(as_they_end(pool, [partial(math.sqrt, -1.0)]))


STUDY = """
import os, time
from studies.runs import process_pool, shared_values

if __name__ == "__main__":
    with shared_values() as manager, process_pool(1) as pool:
        print(pool.submit(os.getpid).result(), manager._process.pid, flush=True)
        pool.submit(time.sleep, 300).result()
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_of_a_study_outlives_it(tmp_path, how):
    (tmp_path / "study.py").write_text(STUDY)
    study = subprocess.Popen(
        [sys.executable, tmp_path / "study.py"], cwd=ROOT, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    others = [psutil.Process(int(pid)) for pid in study.stdout.readline().split()]
    assert len(others) == 2
    study.send_signal(how)
    study.wait()
    _, alive = psutil.wait_procs(others, timeout=20)
    assert not alive


def test_json_says_on_what_machine_and_with_which_versions(tmp_path):
    output = tmp_path / "found.json"
    write_results(output, versions={"torch": "2"}, seed=3, sites=[{"site": 0}])
    document = json.loads(output.read_text())
    assert document["machine"].keys() == {"processor", "cores", "torch"}
    assert (document["seed"], document["sites"]) == (3, [{"site": 0}])
