"""What is read of all cameras at once, for pages, metrics and lists: what it says and costs.

`tests/golden/fleet.json` is what was said before both were read in bulk; `said` made it.
"""

import json
from pathlib import Path

import pytest
from sqlalchemy import event

from service.cameras.cameras import list_cameras
from service.enums import PoseState
from service.operations.health import load_metrics
from service.pages.fleet import list_fleet
from tests.service.conftest import problem
from tests.service.fleet_bench import every_state

GOLDEN = Path(__file__).parents[3] / "tests" / "golden" / "fleet.json"
# What is of this moment or of this process, and not of a camera's state.
MOMENTARY = (
    *("last_track", "oldest_unseen", "queue_lag", "http_", "build"),
    *("estimation_", "result_age"),
)


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


def list_some(session, settings):
    return list_cameras(session, settings, "", 1000)


def list_those_of_a_state(session, settings):
    return list_cameras(session, settings, "", 1000, [PoseState.LEARNING, PoseState.DRIFTING])


@pytest.mark.parametrize("read", [load_metrics, list_fleet, list_some, list_those_of_a_state])
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
    assert statements() == few <= 17


def test_the_list_says_of_each_camera_what_its_pose_and_its_page_say(http, fleet):
    every_state(fleet, range(24))
    fleet.add("new", state="unconnected", tracks=0)
    items = http.get("/cameras").json()["items"]
    assert len(items) == 25
    for item in items:
        served = http.get(f"/cameras/{item['id']}/pose").json()
        alone = http.get(f"/cameras/{item['id']}").json()
        assert (item["state"], item["reference"]) == (served["state"], served["reference"])
        assert alone == item
    with fleet.store.read() as session:
        rows = {row.id: row for row in list_fleet(session, fleet.settings)}
    assert {item["id"]: item["state"] for item in items} == {i: r.state for i, r in rows.items()}
    learning = {
        item["id"]: item["reference"]["counted"]
        for item in items
        if item["reference"]["state"] == "learning" and item["state"] != "unconnected"
    }
    learned = {i: row.learned for i, row in rows.items() if row.learned is not None}
    assert learned == learning
    assert len(set(learned.values())) > 1


def test_a_list_of_some_states_has_all_pages_of_these_alone(http, fleet):
    every_state(fleet, range(24))
    known = {item["id"]: item["state"] for item in http.get("/cameras").json()["items"]}
    wanted = ["drifting", "no_data"]
    found, cursor = [], ""
    while cursor is not None:
        asked = {"state": wanted, "limit": 3, "cursor": cursor}
        page = http.get("/cameras", params=asked).json()
        assert len(page["items"]) <= 3
        found += [(item["id"], item["state"]) for item in page["items"]]
        cursor = page["next_cursor"]
    assert found == [(i, state) for i, state in known.items() if state in wanted]
    assert len(found) > 3
    assert http.get("/cameras", params={"state": "unconnected"}).json()["items"] == []
    told = problem(http.get("/cameras", params={"state": "lost"}), 422, "malformed")
    assert "lost" in told["detail"]
