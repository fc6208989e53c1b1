"""The engine's own housekeeping, in a process of its own: the engine is global to a process."""

import subprocess
import sys

PROGRAM = """
from datetime import timedelta

from dbos import DBOS

from service.job_queue import engine_config
from service.workers import engine
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


TURNS = """
import time
from datetime import UTC, datetime, timedelta

from dbos import DBOS

from service.job_queue import ESTIMATE_JOB, JobQueue, engine_config
from service.settings import Settings
from service.store.engines.store import Store

settings = Settings()
store = Store(settings)
queue = JobQueue(store.engine)
now = datetime.now(UTC)
asked = [("c", 3, False), ("b", 20, False), ("may have moved", 10, True), ("a", 60, False)]
with store.write() as session:
    for camera_id, due_s, urgent in asked:
        queue.enqueue_estimate(session, camera_id, now - timedelta(seconds=due_s), urgent=urgent)
DBOS(config=engine_config(settings, "w"))
turns = []

@DBOS.workflow(name=ESTIMATE_JOB)
def estimate(camera_id):
    turns.append(camera_id)

DBOS.launch()
DBOS.register_queue(ESTIMATE_JOB, worker_concurrency=1, polling_interval_sec=0.05)
while len(turns) < len(asked):
    time.sleep(0.05)
print(", ".join(turns))
DBOS.destroy()
"""


def test_the_longest_due_come_first_and_those_that_may_have_moved_before(settings):
    done = subprocess.run(
        [sys.executable, "-c", TURNS],
        env=settings.as_environment(),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.stdout.strip() == "a, may have moved, b, c", done.stderr
