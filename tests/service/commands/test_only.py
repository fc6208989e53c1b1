"""`surefoot worker --only`: which jobs it begins, and which it leaves to others."""

import contextlib
import os
import re
import time

import pytest

from service.workers.processes.process import WorkKind
from tests.conftest import track
from tests.running import wait_for
from tests.service.commands import forked
from tests.stores.databases import ask

JOBS = "SELECT name, status FROM workflow_status WHERE queue_name IN ('train', 'estimate')"


def begun(settings):
    """Whether a worker has taken it, by the name of each job."""
    return {name: status != "ENQUEUED" for name, status in ask(settings, JOBS)}


@contextlib.contextmanager
def worker_for(only, settings, folder):
    """A real worker for one kind of work, as long as the block lasts."""
    log = folder / f"{only}.log"
    words = ["worker", "--name", only, "--only", only]
    process = forked.Forked(words, settings.as_environment(), log, log)
    try:
        yield process
        assert process.poll() is None, log.read_text()
    finally:
        process.kill()
        process.wait(10)


@pytest.mark.slow
@pytest.mark.parametrize("only", WorkKind)
def test_a_worker_for_one_kind_begins_that_and_leaves_the_rest(corner, settings, tmp_path, only):
    answer = corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]})
    assert answer.status_code == 202
    assert begun(settings) == {"train": False, "estimate": False}
    with worker_for(only, settings, tmp_path):
        wait_for(lambda: begun(settings)[only], 30)
        time.sleep(2.5)  # the queue of trainings is looked at every 2 s
        assert begun(settings) == {name: name == only for name in WorkKind}
    other = next(name for name in WorkKind if name != only)
    with worker_for(other, settings, tmp_path):
        wait_for(lambda: begun(settings)[other], 30)


def test_a_kind_that_is_none_is_refused_and_named(tmp_path):
    environment = {**os.environ, "SUREFOOT_DATA_DIR": str(tmp_path / "data")}
    ended = forked.run(["worker", "--only", "rest"], environment, tmp_path, timeout_s=30)
    assert (ended.returncode, ended.stdout) == (2, "")
    told = re.sub(r"[\s│]+", " ", ended.stderr)
    assert "'--only': Value error, 'rest' is not one of 'estimate', 'train'." in told
    assert not (tmp_path / "data").exists()
