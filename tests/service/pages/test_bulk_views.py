"""What is read of all cameras at once, for the fleet page and for metrics: what it says and costs.

`tests/golden/fleet.json` is what was said before both were read in bulk; `said` made it.
"""

import json
from pathlib import Path

import pytest
from sqlalchemy import event

from service.operations.health import load_metrics
from service.pages.fleet import list_fleet
from tests.service.fleet_bench import Fleet, every_state

GOLDEN = Path(__file__).parents[3] / "tests" / "golden" / "fleet.json"
# What is of this moment or of this process, and not of a camera's state.
MOMENTARY = ("last_track", "oldest_unseen", "queue_lag", "http_", "build")


@pytest.fixture
def fleet(http, settings):
    made = Fleet(settings)
    yield made
    made.close()


def said(http, fleet):
    """The metrics and the rows of a fleet, without what changes as time goes on."""
    text = http.get("/metrics").text
    with fleet.store.read() as session:
        rows = [
            [row.id, row.state, row.words, row.flags, row.share, row.training, row.history]
            for row in list_fleet(session, fleet.settings)
        ]
    lines = [line for line in text.splitlines() if line.startswith("surefoot_")]
    metrics = [line for line in lines if not any(word in line for word in MOMENTARY)]
    return {"metrics": metrics, "rows": json.loads(json.dumps(sorted(rows)))}


def test_a_fleet_in_all_states_is_told_of_as_before(http, fleet):
    every_state(fleet, range(24))
    found, golden = said(http, fleet), json.loads(GOLDEN.read_text())
    assert found["metrics"] == golden["metrics"]
    assert found["rows"] == golden["rows"]


@pytest.mark.parametrize("read", [load_metrics, list_fleet])
def test_as_many_statements_are_asked_for_many_cameras_as_for_few(fleet, settings, read):
    def statements():
        seen = []

        def note(_conn, _cursor, statement, *_):
            seen.append(statement)

        event.listen(fleet.store.engine, "before_cursor_execute", note)
        with fleet.store.read() as session:
            read(session, settings)
        event.remove(fleet.store.engine, "before_cursor_execute", note)
        return len([text for text in seen if text.startswith(("SELECT", "WITH"))])

    every_state(fleet, range(3))
    few = statements()
    every_state(fleet, range(3, 36))
    assert statements() == few <= 15
