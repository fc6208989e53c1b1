"""No code comes out of the job tables, whoever has written to them.

A pickle is a program: reading one runs it. These touch a file where they are read.
"""

import base64
import os
import pickle
import re
from importlib.util import find_spec
from pathlib import Path

from service.commands.migrate import migrate
from service.job_queue import JOBS_FORM
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.workers.programs import ESTIMATES, run
from tests.stores.databases import ask

PLANT = (
    "INSERT INTO workflow_status (workflow_uuid, status, name, created_at, updated_at, priority, "
    "application_version, queue_name, deduplication_id, serialization, inputs) "
    "VALUES ('planted', 'ENQUEUED', 'estimate', 1, 1, 0, '1', 'estimate', 'corner', 'py_pickle', "
    "'{0}')",
    "INSERT INTO workflow_input (workflow_uuid, inputs, retention_timestamp) "
    "VALUES ('planted', '{0}', 1)",
)


class Touch:
    """Pickled, it makes a file of whoever reads it."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def planted(path):
    """The statements that put a job into the tables which touches a file."""
    job = base64.b64encode(pickle.dumps({"args": (Touch(path),), "kwargs": {}})).decode()
    return [statement.format(job) for statement in PLANT]


PROGRAM = (
    ESTIMATES
    + """
def rest():
    while DBOS.list_workflows(status=["ENQUEUED", "PENDING"], load_input=False):
        time.sleep(0.05)

ask("honest", datetime.now(UTC))
launch()
rest()
ask("corner", datetime.now(UTC))  # whose place the planted one held
rest()
print(ran, {one.workflow_id: one.status for one in DBOS.list_workflows()}["planted"])
DBOS.destroy()
"""
)


def test_a_planted_pickle_is_not_read_and_holds_up_nobody(settings, tmp_path):
    for statement in planted(tmp_path / "pwned"):
        ask(settings, statement)
    done = run(PROGRAM, settings)
    assert done.stdout == "['honest', 'corner'] ERROR\n", done.stderr
    assert "it is not read" in done.stderr
    assert not (tmp_path / "pwned").exists()


def test_a_start_deletes_pickles_and_what_was_to_be_done_is_queued_anew(settings, corner, tmp_path):
    """As of a release that kept them, whose jobs were waiting when it was stopped."""
    assert corner.post("/cameras", json={**CAMERA, "id": "other"}).status_code == 201
    ask(settings, "UPDATE workflow_status SET serialization = 'py_pickle' WHERE name = 'train'")
    before = count(settings, "workflow_status")
    for statement in planted(tmp_path / "pwned"):
        ask(settings, statement)
    migrate(settings)
    assert count(settings, "workflow_status") < before
    assert count(settings, "workflow_input") == count(settings, "workflow_status")
    assert forms(settings) <= {JOBS_FORM}
    assert not (tmp_path / "pwned").exists()


def test_all_that_is_queued_is_json(settings, corner):
    assert corner.post("/cameras/corner/trainings").status_code == 202
    assert forms(settings) == {JOBS_FORM}


def test_the_engine_has_no_other_way_to_read_a_pickle():
    """Of the pinned version: one line of one function, which is replaced by a refusal."""
    spec = find_spec("dbos")
    assert spec is not None
    assert spec.origin is not None
    found = [
        (path.name, line.strip())
        for path in sorted(Path(spec.origin).parent.rglob("*.py"))
        for line in path.read_text().splitlines()
        if re.search(r"pickle\.loads?\(|Unpickler\(|marshal\.|\beval\(|\bexec\(", line)
    ]
    assert found == [("_serialization.py", "return pickle.loads(pickled_data)")]


def count(settings, table):
    with Store(settings).read() as session:
        return session.connection().exec_driver_sql(f"SELECT count(*) FROM {table}").scalar()


def forms(settings):
    with Store(settings).read() as session:
        query = "SELECT DISTINCT serialization FROM workflow_status"
        return set(session.connection().exec_driver_sql(query).scalars())
