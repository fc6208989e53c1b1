"""Databases of every release, with rows in all tables, brought to now; and of no release."""

import contextlib
import json
import shutil
import sqlite3
import stat
import struct
import time

import alembic.command
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.commands.migrate import migrate
from service.data_dir import StartError
from service.settings import Settings
from service.store.engines import files, revisions
from service.store.engines.revisions import alembic_config, known_revisions
from tests.stores.databases import ask
from tests.test_migrations import put

REVISIONS = known_revisions()[::-1]
ENGINE_AND_ALEMBIC = {"alembic_version", "sqlite_sequence"}
NOW_S = time.time() - 3600
NUMBERS = {"height_m": 6.1, "tilt_rad": 0.38, "roll_rad": 0.02, "heading_rad": 0.7}
INTRINSICS = {"width": 1280, "height": 720, "fx": 1100.0, "fy": 1100.0, "cx": 639.5, "cy": 359.5}
TURNED = json.dumps([{"code": "as_said", "values": {"text": "it has turned"}}])
CALLED = {
    "cameras": {"id": "corner", "name": "The corner", "distortion": "[0, 0, 0, 0, 0]",
                "projection": "perspective",
                "reference_tracks": 50, "walking_speed_mean_mps": 1.4, "walking_speed_sd_mps": 0.1,
                **INTRINSICS},
    "prior_poses": {"id": 1, "origin": "registered", **NUMBERS},
    "site_references": {"id": 1, "origin": "registered", "wanted": 50, "tracks": 1,
                        "from_s": NOW_S - 50, "data": None, "ready_at": None},
    "flow_maps": {"reference_id": 1, "data": None, "chart": None},
    "anchors": {"reference_id": 1, "creep": None},
    "tracks": {"id": 1, "source": "s", "track_id": "17", "started_s": NOW_S, "ended_s": NOW_S + 8,
               "points": b"".join(struct.pack("<3d", NOW_S + 0.4 * n, 300 + 12 * n, 400 + 5 * n)
                                  for n in range(20))},
    "trainings": {"id": "t" * 32, "recipe": "default", "state": "succeeded", "metrics": "{}"},
    "models": {"id": "m" * 32, "training_id": "t" * 32, "weights_sha256": "0" * 64,
               "config": "{}", "metrics": "{}", "step_s": 0.4},
    "predictions": {"model_id": "m" * 32, "track_pk": 1, "windows": 0},
    "estimates": {"id": 1, "model_id": "m" * 32, "state": "ok", "raw": "{}", "told": '["tilt"]',
                  "moved_parameters": "{}", "alternatives": "[]", "detectable": "{}",
                  "suspected": 0, "reference_id": 1, "newest_track_pk": 1, "tracks": 1,
                  "covariance": str([[0.0] * 4] * 4), "from_s": NOW_S, "to_s": NOW_S + 8,
                  **NUMBERS},
    "alerts": {"id": "a" * 32, "kind": "drift", "state": "firing", "severity": "critical",
               "source": "estimate", "reasons": TURNED, "told": 1,
               "drift": json.dumps({"angle_rad": 0.115, "tilt_rad": 0.105, "roll_rad": 0.017,
                                    "heading_rad": 0.0, "height_m": 0.1})},
    "events": {"id": 1, "type": "alert", "payload": "{}"},
    "workers": {"name": "local-0"},
    "bridges": {"name": "surefoot-bridge", "recent_starts": "[]", "report": "{}"},
    "webhooks": {"id": "w" * 32, "name": "duty", "url": "https://example.org/h", "kinds": None,
                 "format": "webhook", "enabled": 0, "disabled_reasons": TURNED, "secret": None},
    "deliveries": {"number": 1, "id": "d" * 32, "webhook_id": "w" * 32, "alert_id": "a" * 32,
                   "type": "alert.opened", "payload": "{}", "state": "delivered"},
    "delivery_attempts": {"id": 1, "delivery_number": 1, "status_code": 204},
    "maintenance_windows": {"id": "n" * 32, "from_at": "2026-11-20 08:00:00"},
    "camera_rhythms": {"profile": None, "counts": '{"tracks": {}, "latest_s": {}}'},
    "access_tokens": {"id": "some"},
    "snapshots": {"jpeg": b"a picture", "sha256": "0" * 64, "width": 1280, "height": 720},
    "plans": {"jpeg": b"a plan", "sha256": "0" * 64, "metres_per_pixel": 0.1, "north_rad": 0.0},
    "pictures": {"digest": "0" * 64, "turn": "[0, 0, 0]",
                 "covariance": str([[1e-6 * (i == k) for k in range(3)] for i in range(3)])},
    "picture_references": {"features": b"features"},
    "zones": {"zones": json.dumps([{"id": "gate", "on": "ground",
                                    "corners": [[400, 500], [800, 500], [800, 600]]}]),
              "form": None, "document": None, "pose": json.dumps(NUMBERS | {"x_m": 0, "y_m": 0}),
              "intrinsics": json.dumps(INTRINSICS | {"distortion": [0, 0, 0, 0, 0]})},
    "activity": {"what": "camera.registered", "by": "Ada", "details": "{}"},
}  # fmt: skip


@pytest.fixture(scope="module")
def released(tmp_path_factory):
    """The data directory of a revision, with a row in each of its tables; made once each.

    Each begins where the one before it ended, empty: the way to all of them is gone once.
    """
    folder = tmp_path_factory.mktemp("released")

    def empty(revision):
        path = folder / f"{revision}.sqlite"
        if not path.exists():
            number = REVISIONS.index(revision)
            if number:
                shutil.copy(empty(REVISIONS[number - 1]), path)
            alembic.command.upgrade(alembic_config(f"sqlite:///{path}"), revision)
            files.drop_log(path)
        return path

    def make(revision):
        settings = Settings(data_dir=folder / revision)
        if not settings.data_dir.exists():
            settings.data_dir.mkdir(mode=0o755)
            shutil.copy(empty(revision), settings.database_path)
            with contextlib.closing(sqlite3.connect(settings.database_path)) as connection:
                connection.execute("PRAGMA foreign_keys=ON")
                fill(connection)
                connection.commit()
            files.drop_log(settings.database_path)
            settings.database_path.chmod(0o644)
        return settings.data_dir

    return make


def fill(connection):
    """A row in each table, parents first."""
    waiting = names(connection)
    for table in [name for name in CALLED if name in waiting] + sorted(waiting - set(CALLED)):
        columns = {row[1]: row[2] for row in connection.execute(f"PRAGMA table_info({table})")}
        own = {"camera_id": "corner", "prior_pose_id": 1, **CALLED.get(table, {})}
        values = {name: value for name, value in own.items() if name in columns}
        put(connection, table, **values)


def names(connection):
    rows = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
    return {row[0] for row in rows} - ENGINE_AND_ALEMBIC


def content(path):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return list(connection.iterdump())


def rows_of(path):
    with sqlite3.connect(path) as connection:
        return {
            table: connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
            for table in names(connection)
        }


@pytest.mark.parametrize("revision", REVISIONS)
def test_a_database_of_a_revision_keeps_its_rows_and_is_served(released, tmp_path, revision):
    settings = Settings(data_dir=tmp_path / "data", epochs=1)
    shutil.copytree(released(revision), settings.data_dir)
    before = rows_of(settings.database_path)
    assert set(before.values()) == {1}
    migrate(settings)
    path = settings.database_path
    assert files.revision(path) == REVISIONS[-1]
    assert files.faults(path) == []
    assert files.broken_references(path) == {}
    assert ask(settings, "PRAGMA auto_vacuum") == [(2,)]  # it can shrink
    after = rows_of(path)
    assert {table: after[table] for table in before} == before
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with TestClient(create_app(settings)) as http:
        pose = http.get("/cameras/corner/pose").raise_for_status().json()
        assert pose["pose"]["height_m"] == pytest.approx(6.1)
        (alert,) = http.get("/alerts").raise_for_status().json()["items"]
        assert (alert["kind"], alert["severity"]) == ("drift", "critical")
        assert (alert["reason"], alert["reason_code"]) == ("it has turned", "as_said")
        (hook,) = http.get("/webhooks").raise_for_status().json()["items"]
        assert hook["disabled_reason_code"] == "as_said"
        for page in ("/", "/ui/cameras/corner", "/metrics", "/webhooks"):
            http.get(page, headers={"accept": "text/html"}).raise_for_status()
        receipt = http.post("/cameras/corner/tracks", json={"tracks": [
            {"id": "new", "points": [[NOW_S + 100 + 0.4 * n, 300 + 12 * n, 400 + 5 * n]
                                     for n in range(20)]}]})  # fmt: skip
        assert receipt.json()["accepted"] == 1
    copies = list((settings.data_dir / "copies").glob("*.sqlite"))
    assert len(copies) == (revision != REVISIONS[-1])
    for copy in copies:
        assert rows_of(copy) == before
        assert files.revision(copy) == revision
        assert stat.S_IMODE(copy.stat().st_mode) == 0o600


ADDS = "op.add_column('snapshots', sa.Column('later_{n}', sa.Integer()))"
FAILS = f"{ADDS}; op.execute('UPDATE snapshots SET none = 1')"


@pytest.fixture
def release(tmp_path, monkeypatch):
    """Makes the releases after this one, each with a revision that does what it is given."""
    folder = tmp_path / "migrations"
    shutil.copytree(revisions.MIGRATIONS, folder)
    monkeypatch.setattr(revisions, "MIGRATIONS", folder)

    def make(does):
        last, n = known_revisions()[0], len(known_revisions())
        name = f"2099_01_{n:02d}_later"
        (folder / "versions" / f"{name}.py").write_text(
            f"import sqlalchemy as sa\nfrom alembic import op\n\nrevision = {name!r}\n"
            f"down_revision = {last!r}\n\n\ndef upgrade():\n    {does.format(n=n)}\n"
        )
        return name

    return make


def test_a_migration_that_fails_is_undone_and_told(released, release, tmp_path):
    settings = Settings(data_dir=tmp_path / "data")
    shutil.copytree(released(REVISIONS[-1]), settings.data_dir)
    before = content(settings.database_path)
    later = release(FAILS)
    told = f"migration: from {REVISIONS[-1]} to {later} failed .*no such column.* is as it was"
    with pytest.raises(StartError, match=told):
        migrate(settings)
    assert files.revision(settings.database_path) == REVISIONS[-1]
    assert content(settings.database_path) == before
    assert files.faults(settings.database_path) == []


def test_two_copies_are_kept_and_none_where_that_is_said(released, release, tmp_path):
    settings = Settings(data_dir=tmp_path / "data")
    shutil.copytree(released(REVISIONS[-1]), settings.data_dir)
    later = []
    for _ in range(3):
        later.append(release(ADDS))
        migrate(settings)
    copies = sorted((settings.data_dir / "copies").iterdir())
    assert [files.revision(copy) for copy in copies] == later[:2]
    none = Settings(data_dir=tmp_path / "none", copy_before_migration=False)
    shutil.copytree(released(REVISIONS[-1]), none.data_dir)
    migrate(none)
    assert files.revision(none.database_path) == later[-1]
    assert not (none.data_dir / "copies").exists()


def test_a_database_of_before_the_first_release_is_refused_in_one_line(settings):
    ask(settings, "UPDATE alembic_version SET version_num = '2026_12_02_urgent'")
    with pytest.raises(StartError, match="2026_12_02_urgent, of before the first release") as told:
        migrate(settings)
    assert "\n" not in str(told.value)
    assert ask(settings, "SELECT count(*) FROM cameras") == [(0,)]
