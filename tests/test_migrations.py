import json
import sqlite3
from datetime import UTC, datetime

import alembic.command
import pytest
from alembic.script import ScriptDirectory
from fastapi.testclient import TestClient
from sqlalchemy import select, text
from sqlalchemy.exc import IntegrityError

from service.alerts.alerts import list_alerts
from service.app import create_app
from service.cameras.poses import pose_history, view_pose
from service.commands.migrate import migrate
from service.reason_words import in_words
from service.settings import Settings
from service.store import references
from service.store.alerts import AlertFilter
from service.store.database.revisions import alembic_config, known_revisions
from service.store.database.store import Store
from service.store.tables.estimates import EstimateRecord
from service.store.tables.record import Record
from service.store.tracks import sources
from tests.stores.databases import only_sqlite


def test_migrating_twice_changes_nothing(settings):
    migrate(settings)


def test_the_migrated_tables_are_the_declared_ones(settings):
    alembic.command.check(alembic_config(settings.store_url))


def test_the_known_revisions_are_alembics():
    scripts = ScriptDirectory.from_config(alembic_config(""))
    assert known_revisions() == [script.revision for script in scripts.walk_revisions()]


def test_down_to_nothing_and_up_again(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "head")
    alembic.command.downgrade(config, "base")
    with sqlite3.connect(settings.database_path) as connection:
        left = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
    assert left <= {"alembic_version", "sqlite_sequence", "sqlite_autoindex_alembic_version_1"}
    alembic.command.upgrade(config, "head")


# A word for each column that takes those of a vocabulary alone.
WORDS = {
    "prior_poses": {"origin": "registered"},
    "site_references": {"origin": "registered"},
    "trainings": {"state": "succeeded"},
    "estimates": {"state": "ok"},
    "alerts": {"kind": "drift", "state": "firing", "source": "estimate", "severity": "warning"},
    "events": {"type": "pose"},
    "webhooks": {"format": "webhook"},
    "deliveries": {"type": "test", "state": "pending"},
    "activity": {"what": "camera.changed"},
}


def put(connection, table, **values):
    """Insert a row with something in every column that needs it."""
    some = {"JSON": "[]", "DATETIME": "2026-11-20 08:00:00", "BLOB": b""}
    for _, name, kind, needed, default, key in connection.execute(f"PRAGMA table_info({table})"):
        if needed and default is None and not (key and kind == "INTEGER"):
            number = kind in ("INTEGER", "DOUBLE", "FLOAT", "BOOLEAN")
            word = WORDS.get(table, {}).get(name, "some")
            values.setdefault(name, some.get(kind, 1 if number else word))
    names = ", ".join(values)
    marks = ", ".join("?" * len(values))
    connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", list(values.values()))


@pytest.mark.parametrize(("origin", "learned_of"), [("registered", 7), ("accepted", 3)])
def test_a_camera_of_before_there_were_references_begins_one(tmp_path, origin, learned_of):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_21_first")
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="old", distortion="[0, 0, 0, 0, 0]", reference_tracks=50)
        put(connection, "prior_poses", id=1, camera_id="old", origin="registered", heading_rad=0.7)
        if origin == "accepted":
            put(connection, "prior_poses", id=2, camera_id="old", origin=origin,
                created_at="2026-11-20 09:00:00")  # fmt: skip
        for n in range(7):
            put(connection, "tracks", camera_id="old", track_id=str(n), started_s=10.0 * n,
                ended_s=10.0 * n + 8,
                received_at=f"2026-11-20 {'08' if n < 4 else '10'}:00:00")  # fmt: skip
        put(connection, "alerts", id="a", camera_id="old", kind="drift", state="firing")
        put(connection, "trainings", id="t", camera_id="old", prior_pose_id=1)
        put(connection, "models", id="m", camera_id="old", training_id="t", prior_pose_id=1)
        put(connection, "estimates", camera_id="old", model_id="m", prior_pose_id=1)
    migrate(settings)
    with Store(settings).read() as session:
        view = view_pose(session, settings, "old")
        # Its alert fires on, so it is taken for moved; what was told last is served meanwhile.
        assert (view.state, view.identifiable) == ("drifting", ("tilt", "roll", "height"))
        assert (view.reference.tracks, view.reference.wanted) == (learned_of, 50)
        (history,) = pose_history(session, "old", None, None, 10)
        assert history.identifiable == ["tilt", "roll", "height"]
        assert (history.heading_rad, history.heading_sd_rad) == (0.7, None)
        assert history.drift_heading_rad == 0
        assert list_alerts(session, AlertFilter(state="firing"), 10)[0].source == "estimate"
    alembic.command.downgrade(config, "2026_11_21_first")
    with sqlite3.connect(settings.database_path) as connection:
        for table, rows in (("estimates", 1), ("models", 1), ("tracks", 7)):
            assert connection.execute(f"SELECT count(*) FROM {table}").fetchone() == (rows,)


def test_the_newest_reference_is_bound_to_the_source_of_its_tracks(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_24_parent_indexes")
    with sqlite3.connect(settings.database_path) as connection:
        for name in ("fed", "empty"):
            put(connection, "cameras", id=name, distortion="[0, 0, 0, 0, 0]", reference_tracks=50)
            put(connection, "prior_poses", id=len(name), camera_id=name)
            for number in (1, 2):
                put(connection, "site_references", id=10 * len(name) + number, camera_id=name,
                    prior_pose_id=len(name))  # fmt: skip
        for n, source in enumerate(("old", "old", "new")):
            put(connection, "tracks", camera_id="fed", source=source, track_id=str(n),
                started_s=10.0 * n, ended_s=10.0 * n + 8,
                received_at=f"2026-11-20 0{n}:00:00")  # fmt: skip
    migrate(settings)
    with Store(settings).read() as session:
        assert [references.newest(session, name).source for name in ("fed", "empty")] == [
            "new",
            None,
        ]
        found = sources.of_camera(session, "fed")
        assert [(each.name, each.tracks) for each in found] == [("old", 2), ("new", 1)]
        assert found[0].last_seen_at == datetime(2026, 11, 20, 1, tzinfo=UTC)
        assert all(each.told_at is not None for each in found)
    alembic.command.downgrade(config, "2026_11_24_parent_indexes")
    migrate(settings)


def nearly(drift):
    """Its numbers to the last digit but one; what is not told has to be None."""
    return {
        name: None if value is None else pytest.approx(value, rel=1e-15)
        for name, value in drift.items()
    }


def test_what_was_kept_in_degrees_is_told_as_it_was(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_25_track_sources")
    raw = {"joint": {"height_m": 6.4, "tilt_deg": 22.123456789, "roll_deg": -1.7, "tracks": 40},
           "registered": {"height_m": 6.3, "tilt_deg": 21.9, "roll_deg": 1e-17,
                          "heading_deg": -170.3, "tracks": 40}}  # fmt: skip
    drift = {"height_m": None, "tilt_deg": 5.3, "roll_deg": None, "heading_deg": -0.1,
             "angle_deg": 5.4}  # fmt: skip
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="old", distortion="[0, 0, 0, 0, 0]", reference_tracks=50)
        put(connection, "prior_poses", id=1, camera_id="old", origin="registered")
        put(connection, "site_references", id=1, camera_id="old", prior_pose_id=1, doubt="",
            origin="registered", ready_at="2026-11-20 07:00:00", offsets="{}")  # fmt: skip
        for number in range(1, 2103):  # more than two bites of them
            put(connection, "estimates", id=number, camera_id="old", prior_pose_id=1, state="ok",
                reference_id=1, told='["tilt"]', raw=json.dumps(raw))  # fmt: skip
        for kind, told in (("drift", drift), ("no_data", {})):
            put(connection, "alerts", id=kind, camera_id="old", kind=kind, state="resolved",
                source="estimate", severity="warning", drift=json.dumps(told))  # fmt: skip

    def kept():
        with sqlite3.connect(settings.database_path) as connection:
            for query in ("SELECT DISTINCT raw FROM estimates", "SELECT drift FROM alerts"):
                yield from (json.loads(row[0]) for row in connection.execute(f"{query} ORDER BY 1"))

    migrate(settings)
    stored = list(kept())
    assert stored[0]["registered"]["heading_rad"] == pytest.approx(-2.97229572)
    assert "_deg" not in json.dumps(stored)
    with TestClient(create_app(settings)) as http:
        told = http.get("/cameras/old/pose").json()["estimates"]
        found = {each["id"]: each["drift"] for each in http.get("/alerts").json()["items"]}
    for name, body in raw.items():
        assert told[name] == pytest.approx(body, rel=1e-15)
    assert found == {"drift": nearly(drift), "no_data": {}}
    alembic.command.downgrade(config, "2026_11_25_track_sources")
    again, *alerts = kept()
    assert list(again["registered"]) == list(raw["registered"])
    assert again["joint"] == pytest.approx(raw["joint"], rel=1e-15)
    assert nearly(drift) in alerts


def test_what_was_said_in_sentences_stays_readable(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_26_closed_words")
    source = 'byte\'s "own"'
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="old", distortion="[0, 0, 0, 0, 0]", reference_tracks=50)
        put(connection, "prior_poses", id=1, camera_id="old", origin="registered")
        for number, doubt in ((1, "people walk at 3 m/s"), (2, "")):
            put(connection, "site_references", id=number, camera_id="old", prior_pose_id=1,
                origin="registered", doubt=doubt)  # fmt: skip
        put(connection, "estimates", camera_id="old", prior_pose_id=1, state="ok",
            reason="it's 5 \"deg\"; so")  # fmt: skip
        known = {"state": "firing", "severity": "critical", "drift": "{}"}
        put(connection, "alerts", id="one", camera_id="old", kind="drift", source="estimate",
            reason="far", **known)  # fmt: skip
        put(connection, "alerts", id="all", kind="no_data", source="group", reason="3 cameras of",
            camera_ids='["a", "b", "old"]', track_source=source, **known)  # fmt: skip
    alembic.command.upgrade(config, "head")
    with Store(settings).read() as session:
        first, second = references.of_camera(session, "old", 2)[::-1]
        assert (in_words(first.doubts), second.doubts) == ("people walk at 3 m/s", ())
        (estimate,) = session.scalars(select(EstimateRecord))
        assert in_words(estimate.reasons) == 'it\'s 5 "deg"; so'
        alerts = {alert.id: alert for alert in list_alerts(session, AlertFilter(), 10)}
        assert (alerts["one"].reason, alerts["one"].reason_code) == ("far", "as_said")
        assert alerts["all"].reason_code == "fell_silent_together"
        assert alerts["all"].reason_values == {"cameras": 3, "track_source": source}
        assert alerts["all"].reason.startswith(f"3 cameras of the tracker {source!r} fell silent")
    alembic.command.downgrade(config, "2026_11_26_closed_words")
    with sqlite3.connect(settings.database_path) as connection:
        said = connection.execute("SELECT reason FROM alerts ORDER BY id").fetchall()
        assert said == [("fell_silent_together",), ("far",)]
        said = connection.execute("SELECT doubt FROM site_references ORDER BY id").fetchall()
        assert said == [("people walk at 3 m/s",), ("",)]


def test_making_tables_anew_keeps_numbers_and_triggers(tmp_path):
    settings = Settings(data_dir=tmp_path)
    config = alembic_config(settings.store_url)
    alembic.command.upgrade(config, "2026_11_25_track_sources")
    with sqlite3.connect(settings.database_path) as connection:
        for number in (7, 8):
            put(connection, "events", id=number, type="alert", payload="{}")
        connection.execute("DELETE FROM events WHERE id = 8")
        put(connection, "activity", what="pose.accepted", details="{}")
        connection.execute("UPDATE sqlite_sequence SET seq = 41 WHERE name = 'activity'")
    for revision in ("head", "2026_11_25_track_sources"):
        way = alembic.command.upgrade if revision == "head" else alembic.command.downgrade
        way(config, revision)
        with sqlite3.connect(settings.database_path) as connection:
            insert = "INSERT INTO events (type, payload, created_at) VALUES ('pose', '{}', '2026')"
            numbers = [connection.execute(insert).lastrowid]
            connection.rollback()
            with pytest.raises(sqlite3.IntegrityError, match="never changed"):
                connection.execute("UPDATE activity SET by = 'Eve'")
            (last,) = connection.execute(
                "SELECT seq FROM sqlite_sequence WHERE name = 'activity'"
            ).fetchone()
            assert (numbers, last) == ([9], 41)


@only_sqlite("looks at the file")
def test_the_file_is_in_wal_mode_with_foreign_keys(settings):
    with Store(settings).read() as session:
        assert session.scalar(text("PRAGMA journal_mode")) == "wal"
        assert session.scalar(text("PRAGMA foreign_keys")) == 1
        assert session.scalar(text("PRAGMA busy_timeout")) == 30000


@only_sqlite("looks at the file")
def test_a_track_needs_its_camera(settings):
    insert = text(
        "INSERT INTO tracks (camera_id, source, track_id, started_s, ended_s, points, received_at)"
        " VALUES ('nobody', 's', '1', 0, 1, x'', '2026-01-01')"
    )
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), Store(settings).write() as session:
        session.execute(insert)


def test_every_constraint_has_a_name(settings):
    for table in Record.metadata.sorted_tables:
        for constraint in table.constraints:
            assert constraint.name, (table.name, constraint)
