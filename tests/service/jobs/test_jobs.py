"""The engine's own housekeeping, in a process of its own: the engine is global to a process."""

import subprocess
import sys

PROGRAM = """
from datetime import timedelta

from dbos import DBOS

from service.job_queue import engine_config
from service.jobs import engine
from service.settings import Settings

settings = Settings()
DBOS(config=engine_config(settings, "w"))

@DBOS.workflow(name="noop")
def noop():
    pass

DBOS.launch()
for _ in range(7):
    noop()
engine.forget_finished()
print(len(DBOS.list_workflows()))
engine._KEEP_FINISHED = timedelta(hours=-1)
engine._FORGET_AT_ONCE = 3
engine.forget_finished()
print(len(DBOS.list_workflows()))
DBOS.destroy()
"""


def test_jobs_that_ended_a_while_ago_are_forgotten(settings):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=settings.as_environment(),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.stdout.split() == ["7", "0"], done.stderr
