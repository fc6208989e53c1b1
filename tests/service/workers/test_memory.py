"""The limit of a worker's memory: an allocation fails in the job that makes it, and no process."""

import subprocess
import sys

LIMITED = """
import numpy, threading
from service.workers.processes.process import limit_memory

limit_memory(600.0)
try:
    numpy.ones(200_000_000)
    print("taken")
except MemoryError as error:
    print(repr(error)[:11])
print(numpy.ones(1_000_000).sum())
limit_memory(None)
print(numpy.empty(200_000_000).nbytes)
"""


def test_what_asks_for_too_much_fails_alone():
    told = subprocess.run(
        [sys.executable, "-c", LIMITED], capture_output=True, text=True, check=True
    )
    assert told.stdout.splitlines() == ["MemoryError", "1000000.0", "1600000000"]
