"""The log of what was done: it only grows, outlives cameras, and can be taken elsewhere."""

import json
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from service.access.activity import note
from service.enums import Activity
from service.store.engines.store import Store
from service.store.journal import ActivityRecord
from service.workers.upkeep.retention import limits_of_all
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem


def entries(http, **query):
    return http.get("/activity", params=query).json()["items"]


def whats(http, **query):
    return [entry["what"] for entry in entries(http, **query)]


def test_what_is_done_at_a_camera_is_kept_in_order_and_outlives_it(bench):
    http = bench.http
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    (alert,) = bench.alerts()
    http.post(f"/alerts/{alert['id']}/acknowledge", json={"by": "Ada"}).raise_for_status()
    http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).raise_for_status()
    http.post("/cameras/corner/trainings", json={"by": "Bo"}).raise_for_status()
    http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    found = entries(http, camera_id="corner")
    assert [(entry["what"], entry["by"]) for entry in found] == [
        ("camera.registered", None),
        ("training.succeeded", None),
        ("alert.opened", None),
        ("alert.acknowledged", "Ada"),
        ("alert.resolved", "Ada"),
        ("pose.accepted", "Ada"),
        ("training.requested", "Bo"),
        ("camera.removed", None),
    ]
    assert found[2]["subject_id"] == alert["id"]
    assert found[2]["kind"] == "drift"
    http.post("/cameras", json=CAMERA).raise_for_status()
    assert whats(http, camera_id="corner")[-2:] == ["camera.removed", "camera.registered"]


def test_pages_by_cursor_come_to_all_of_it(http):
    for n in range(5):
        http.post("/cameras", json={**CAMERA, "id": f"c{n}"}).raise_for_status()
    first = http.get("/activity", params={"limit": 2}).json()
    assert [item["camera_id"] for item in first["items"]] == ["c0", "c1"]
    rest = http.get("/activity", params={"limit": 3, "after": first["next_cursor"]}).json()
    assert [item["camera_id"] for item in rest["items"]] == ["c2", "c3", "c4"]
    assert rest["next_cursor"] is None
    problem(http.get("/activity", params={"after": "9" * 30}), 422, "malformed")


def test_as_lines_it_can_be_taken_elsewhere(http, settings):
    with Store(settings).write() as session:
        for n in range(1203):
            note(session, Activity.TOKEN_ADDED, by=f"n{n}")
    answer = http.get("/activity", headers={"Accept": "application/x-ndjson"})
    assert answer.headers["content-type"].startswith("application/x-ndjson")
    lines = [json.loads(line) for line in answer.text.splitlines()]
    assert [line["by"] for line in lines] == [f"n{n}" for n in range(1203)]
    some = http.get("/activity?limit=600", headers={"Accept": "application/x-ndjson"})
    assert len(some.text.splitlines()) == 600


def test_nothing_changes_or_deletes_an_entry(http, settings):
    store = Store(settings)
    with store.write() as session:
        note(session, "token.added", by="Ada")
    for statement in ("UPDATE activity SET by = 'Bo'", "DELETE FROM activity"):
        with pytest.raises(IntegrityError, match="activity: entries"), store.write() as session:
            session.execute(text(statement))
    assert entries(http)[-1]["by"] == "Ada"


def test_only_age_ends_an_entry(settings):
    store = Store(settings)
    now = datetime.now(UTC)
    with store.write() as session:
        for days in (2000, 1826, 1824, 0):
            at = now - timedelta(days=days)
            what = Activity.CAMERA_CHANGED
            session.add(ActivityRecord(what=what, at=at, note=f"{days}", details={}))
    with store.write() as session:
        limits = {limit.name: limit for limit in limits_of_all(settings)}
        assert limits["activity"].bite(session) == 2
    with store.read() as session:
        assert session.execute(text("SELECT note FROM activity")).all() == [("1824",), ("0",)]


def test_the_page_tells_what_the_log_tells(bench):
    bench.see(PRIOR)
    bench.http.post("/cameras/corner/trainings", json={"by": "Bo"}).raise_for_status()
    page = bench.http.get("/ui/cameras/corner").text
    for words in ("Someone registered the camera.", "Bo asked for a training."):
        assert words in page
