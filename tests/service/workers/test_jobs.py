"""The engine's own housekeeping, in a process of its own: the engine is global to a process."""

from tests.service.workers.programs import ESTIMATES, run

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
    done = run(PROGRAM, settings)
    assert done.stdout.split() == ["7", "0"], done.stderr


TURNS = (
    ESTIMATES
    + """
now = datetime.now(UTC)
asked = [("c", 3, False), ("b", 20, False), ("may have moved", 10, True), ("a", 60, False)]
for camera_id, due_s, urgent in asked:
    ask(camera_id, now - timedelta(seconds=due_s), urgent=urgent)
launch()
while len(ran) < len(asked):
    time.sleep(0.05)
print(", ".join(ran))
DBOS.destroy()
"""
)


def test_the_longest_due_come_first_and_those_that_may_have_moved_before(settings):
    done = run(TURNS, settings)
    assert done.stdout.strip() == "a, may have moved, b, c", done.stderr
