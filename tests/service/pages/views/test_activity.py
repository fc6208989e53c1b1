"""The log of what was done: it only grows, outlives cameras, and can be taken elsewhere."""

import json
import sqlite3
from datetime import UTC, datetime, timedelta

import alembic.command
import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from service.access.activity import note
from service.commands.migrate import alembic_config, migrate
from service.enums import Activity
from service.settings import Settings
from service.store.database.store import Store
from service.store.tables.activity import ActivityRecord
from service.workers.upkeep.limits import limits_of_all
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem
from tests.test_migrations import put


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


def test_what_is_known_of_the_past_is_carried_over(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_22_snapshots")
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="c", distortion="[0, 0, 0, 0, 0]", reference_tracks=50)
        put(connection, "prior_poses", id=1, camera_id="c", origin="registered",
            created_at="2026-11-20 08:00:00", trusted_by=None)  # fmt: skip
        put(connection, "prior_poses", id=2, camera_id="c", origin="accepted", trusted_by="Ada",
            created_at="2026-11-20 12:00:00")  # fmt: skip
        put(connection, "site_references", id=1, camera_id="c", prior_pose_id=1,
            origin="registered", ready_at="2026-11-20 09:00:00")  # fmt: skip
        put(connection, "site_references", id=2, camera_id="c", prior_pose_id=1, origin="reset",
            requested_by="Bo", created_at="2026-11-20 11:00:00")  # fmt: skip
        put(connection, "alerts", id="a", camera_id="c", kind="drift", state="resolved",
            opened_at="2026-11-20 10:00:00", resolved_at="2026-11-20 10:40:00", outcome="put_back",
            resolved_by="Bo")  # fmt: skip
        put(connection, "alert_acts", id=1, alert_id="a", act="acknowledged", by="Ada",
            at="2026-11-20 10:20:00", note="on it")  # fmt: skip
        put(connection, "alert_acts", id=2, alert_id="a", act="resolved", by="Bo",
            outcome="put_back", at="2026-11-20 10:40:00")  # fmt: skip
        put(connection, "alerts", id="b", camera_id="c", kind="no_data", state="firing",
            opened_at="2026-11-20 13:00:00")  # fmt: skip
        put(connection, "maintenance_windows", id="w", camera_id="c", requested_by="Cy",
            created_at="2026-11-20 14:00:00", to_at="2026-11-20 16:00:00",
            reason="lens")  # fmt: skip
        put(connection, "trainings", id="t", camera_id="c", prior_pose_id=1, state="failed",
            error="too few", finished_at="2026-11-20 15:00:00")  # fmt: skip
    migrate(settings)
    with sqlite3.connect(settings.database_path) as connection:
        rows = connection.execute("SELECT what, by, kind, outcome, note FROM activity ORDER BY id")
        assert rows.fetchall() == [
            ("camera.registered", None, None, None, None),
            ("reference.learned", None, None, None, None),
            ("alert.opened", None, "drift", None, None),
            ("alert.acknowledged", "Ada", "drift", None, "on it"),
            ("alert.resolved", "Bo", "drift", "put_back", None),
            ("reference.reset", "Bo", None, None, None),
            ("pose.accepted", "Ada", None, None, None),
            ("alert.opened", None, "no_data", None, None),
            ("maintenance.planned", "Cy", None, None, "lens"),
            ("training.failed", None, None, None, "too few"),
        ]
    alembic.command.downgrade(config, "2026_11_22_snapshots")
    with sqlite3.connect(settings.database_path) as connection:
        rows = connection.execute("SELECT alert_id, act, by FROM alert_acts ORDER BY id").fetchall()
        assert rows == [("a", "acknowledged", "Ada"), ("a", "resolved", "Bo")]


def test_the_page_tells_what_the_log_tells(bench):
    bench.see(PRIOR)
    bench.http.post("/cameras/corner/trainings", json={"by": "Bo"}).raise_for_status()
    page = bench.http.get("/ui/cameras/corner").text
    for words in ("Someone registered the camera.", "Bo asked for a training."):
        assert words in page
