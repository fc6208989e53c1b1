"""Programs that use the job engine, each a process: the engine is global to one."""

import subprocess
import sys

# The store, the queue, and estimates that are run by this process, which keeps whom they are about.
ESTIMATES = """
import time
from datetime import UTC, datetime, timedelta

from dbos import DBOS

from service.job_queue import ESTIMATE_JOB, JobQueue, engine_config
from service.settings import Settings
from service.store.engines.store import Store

settings = Settings()
store = Store(settings)
queue = JobQueue(store.engine)
ran = []

def ask(camera_id, due_at, **how):
    with store.write() as session:
        queue.enqueue_estimate(session, camera_id, due_at, **how)

def launch():
    DBOS(config=engine_config(settings, "w"))

    @DBOS.workflow(name=ESTIMATE_JOB)
    def estimate(camera_id):
        ran.append(camera_id)

    DBOS.launch()
    DBOS.register_queue(ESTIMATE_JOB, worker_concurrency=1, polling_interval_sec=0.05)
"""


def run(program, settings):
    """A program that has ended, with what it wrote."""
    return subprocess.run(
        [sys.executable, "-c", program],
        env=settings.as_environment(),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
