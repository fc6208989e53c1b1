"""Backups of a data directory that is in use, and what a restore does with each that is damaged."""

import base64
import contextlib
import hashlib
import io
import json
import os
import secrets
import shutil
import sqlite3
import stat
import tarfile
import tempfile
import threading
import time
from pathlib import Path

import pytest

from service.commands.migrate import migrate
from service.data_dir import StartError, held_alone
from service.job_queue import ENGINE_TABLES
from service.notifications.keys import secret_of
from service.operations.backup import write_backup
from service.operations.check import check_data_dir
from service.operations.restore import finish_restore, restore_backup
from service.store.engines import files
from service.store.engines.revisions import known_revisions
from service.store.engines.store import Store
from service.store.record import Record
from service.store.webhooks import WebhookRecord
from tests.conftest import CAMERA, track
from tests.running import wait_for
from tests.service.commands import forked
from tests.service.notifications.test_sealing import hook
from tests.service.workers.test_pickles import planted
from tests.test_migrations import put


def quiet(what, done, total):
    assert 0 <= done <= total


def with_model(settings, content=b"weights of a model"):
    """The migrated data directory with a camera, a model and its weights."""
    digest = hashlib.sha256(content).hexdigest()
    settings.weights_dir.mkdir(exist_ok=True)
    (settings.weights_dir / f"{digest}.safetensors").write_bytes(content)
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="corner")
        put(connection, "prior_poses", id=1, camera_id="corner")
        put(connection, "trainings", id="t", camera_id="corner", prior_pose_id=1)
        put(connection, "models", id="m", camera_id="corner", prior_pose_id=1, training_id="t",
            weights_sha256=digest)  # fmt: skip
    return digest


def test_there_and_back(settings, tmp_path):
    digest = with_model(settings)
    webhook_id, secret = hook(settings)
    archive = tmp_path / "surefoot.tar"
    before = os.umask(0o022)
    try:
        manifest = write_backup(settings, archive, quiet)
    finally:
        os.umask(before)
    assert stat.S_IMODE(archive.stat().st_mode) == 0o600
    assert (manifest.revision, manifest.key) == (known_revisions()[0], "archive")
    with tarfile.open(archive) as tar:
        names = ["manifest.json", "surefoot.sqlite", "secret.key", f"weights/{digest}.safetensors"]
        assert tar.getnames() == names
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []

    fresh = settings.model_copy(update={"data_dir": tmp_path / "fresh"})
    done = restore_backup(fresh, archive, quiet, force=False)
    assert done.replaced is None
    migrate(fresh)
    with Store(fresh).read() as session:
        assert secret_of(fresh, session.get(WebhookRecord, webhook_id)) == secret
    assert {one.what: one.verdict for one in check_data_dir(fresh)}["weights"] == "ok"
    assert {stat.S_IMODE(path.stat().st_mode) for path in fresh.data_dir.rglob("*")} == {
        0o600,
        0o700,
    }

    with pytest.raises(StartError, match="fresh holds data; name an empty folder .* --force"):
        restore_backup(fresh, archive, quiet, force=False)
    (fresh.weights_dir / "later.safetensors").write_bytes(b"later")
    replaced = restore_backup(fresh, archive, quiet, force=True).replaced
    assert (replaced / "weights" / "later.safetensors").exists()
    assert (replaced / "surefoot.sqlite").stat().st_size
    assert [path.name for path in fresh.weights_dir.iterdir()] == [f"{digest}.safetensors"]
    migrate(fresh)


def test_it_is_of_one_moment_however_much_is_written_meanwhile(settings, tmp_path):
    with_model(settings)
    with sqlite3.connect(settings.database_path) as connection:
        filler = secrets.token_bytes(20_000)
        for n in range(1000):
            put(connection, "tracks", id=n, camera_id="corner", track_id=f"old{n}", points=filler)
    stop, written = threading.Event(), []

    def write():
        with sqlite3.connect(settings.database_path, timeout=30) as connection:
            while not stop.is_set():
                put(connection, "tracks", camera_id="corner", track_id=f"new{len(written)}")
                put(connection, "events", type="pose", payload=json.dumps(len(written)))
                connection.commit()
                written.append(time.monotonic())

    writer = threading.Thread(target=write)
    writer.start()
    try:
        wait_for(lambda: written)
        steps = []
        write_backup(
            settings, tmp_path / "b.tar", lambda *step: (steps.append(step), time.sleep(0.005))
        )
        during = len(written)
    finally:
        stop.set()
        writer.join()
    assert during > 20
    copied = [done for what, done, _ in steps if what == "copying the database"]
    assert len(copied) > 2
    assert copied == sorted(copied)  # never begun anew
    with tarfile.open(tmp_path / "b.tar") as tar:
        (tmp_path / "surefoot.sqlite").write_bytes(tar.extractfile("surefoot.sqlite").read())
    with sqlite3.connect(tmp_path / "surefoot.sqlite") as connection:
        (events,) = connection.execute("SELECT count(*) FROM events").fetchone()
        (tracks,) = connection.execute("SELECT count(*) FROM tracks").fetchone()
    assert tracks == 1000 + events
    assert 0 < events < during


def damaged(archive, name, change):
    """A copy of an archive in which a member is changed, or is gone where that returns None."""
    other = archive.with_name("damaged.tar")
    with tarfile.open(archive) as old, tarfile.open(other, "w") as new:
        for header in old:
            data = old.extractfile(header).read()
            if header.name == name:
                data = change(data)
            if data is not None:
                header.size = len(data)
                new.addfile(header, io.BytesIO(data))
    return other


def later_format(data):
    return json.dumps({**json.loads(data), "format": 2}).encode()


def later_schema(data):
    return json.dumps({**json.loads(data), "revision": "2031_later"}).encode()


def out_of_the_folder(data):
    manifest = json.loads(data)
    manifest["members"][0]["name"] = "../surefoot.sqlite"
    return json.dumps(manifest).encode()


def wrong_types(data):
    manifest = json.loads(data)
    manifest["members"][0]["size"] = [1]
    return json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("name", "change", "told"),
    [
        ("surefoot.sqlite", lambda data: data[:-1] + b"\xff", "surefoot.sqlite is damaged"),
        ("surefoot.sqlite", lambda data: data[:-512], "not as its manifest"),
        ("secret.key", lambda data: None, "cut off: secret.key missing"),
        ("manifest.json", later_format, "its format is 2, this release reads up to 1"),
        ("manifest.json", later_schema, "revision 2031_later, newer than this release"),
        ("manifest.json", out_of_the_folder, "'surefoot.sqlite' is not as its manifest"),
        ("manifest.json", lambda data: b"{}", "manifest cannot be read"),
        (
            "manifest.json",
            wrong_types,
            r"cannot be read .members.0.size: Input should be a valid int",
        ),
        ("manifest.json", lambda data: None, "is no backup of surefoot"),
    ],
)
def test_a_damaged_archive_changes_nothing(settings, tmp_path, name, change, told):
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    before = settings.database_path.read_bytes()
    with pytest.raises(StartError, match=told):
        restore_backup(settings, damaged(archive, name, change), quiet, force=True)
    assert settings.database_path.read_bytes() == before
    assert not list(settings.data_dir.glob("rest*"))
    cut = tmp_path / "cut.tar"
    cut.write_bytes(archive.read_bytes()[:100_000])
    with pytest.raises(StartError, match="cut off"):
        restore_backup(settings, cut, quiet, force=True)
    with pytest.raises(StartError, match="is not there"):
        restore_backup(settings, tmp_path / "none.tar", quiet, force=True)


def doctored(archive, *statements):
    """A copy of an archive whose database was changed, with a manifest that fits."""
    database = archive.with_name("doctored.sqlite")

    def change(data):
        database.write_bytes(data)
        with sqlite3.connect(database) as connection:
            for statement in statements:
                connection.execute(statement)
        connection.close()
        return database.read_bytes()

    def describe(data):
        manifest, changed = json.loads(data), database.read_bytes()
        digest = hashlib.sha256(changed).hexdigest()
        manifest["members"][0] |= {"size": len(changed), "sha256": digest}
        return json.dumps(manifest).encode()

    damaged(archive, "surefoot.sqlite", change).rename(archive.with_name("half.tar"))
    return damaged(archive.with_name("half.tar"), "manifest.json", describe)


def test_no_job_comes_out_of_an_archive(settings, tmp_path):
    """Neither into one: what a job is about would be read by the next worker."""
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "cameras", id="corner")
        connection.executescript(";".join(planted(tmp_path / "pwned")))
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    other = doctored(archive, *planted(tmp_path / "pwned"))
    for number, each in enumerate((archive, other)):
        fresh = settings.model_copy(update={"data_dir": tmp_path / f"fresh{number}"})
        restore_backup(fresh, each, quiet, force=False)
        with sqlite3.connect(fresh.database_path) as connection:
            counts = [
                connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
                for table in ("cameras", *ENGINE_TABLES)
            ]
        assert counts == [1] + [0] * len(ENGINE_TABLES)
        found = {one.what: one.verdict for one in check_data_dir(fresh)}
        assert found["job engine"] == "ok"
        assert not files.faults(fresh.database_path)
    assert not (tmp_path / "pwned").exists()


@pytest.mark.parametrize(
    "program",
    [
        "CREATE TRIGGER later AFTER INSERT ON workers BEGIN DELETE FROM access_tokens; END",
        "CREATE TRIGGER activity_more BEFORE UPDATE ON activity "
        "BEGIN SELECT RAISE(ABORT, 'no'); DELETE FROM access_tokens; END",
        "CREATE VIEW later AS SELECT 1",
        "CREATE VIRTUAL TABLE later USING fts5(words)",
    ],
)
def test_an_archive_with_programs_in_it_is_refused(settings, tmp_path, program):
    """A trigger would fill the job tables again, or make a token, when the service first writes."""
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    before = settings.database_path.read_bytes()
    with pytest.raises(StartError, match=r"(trigger|view|table) \w+ that is none of surefoot's"):
        restore_backup(settings, doctored(archive, program), quiet, force=True)
    assert settings.database_path.read_bytes() == before
    with sqlite3.connect(settings.database_path) as connection:
        connection.execute(program)
    found = {one.what: one.verdict for one in check_data_dir(settings)}
    assert found["programs"] == "fault"
    with pytest.raises(StartError, match="none of surefoot's"):
        write_backup(settings, tmp_path / "another.tar", quiet)


def test_the_engine_has_no_table_that_is_not_emptied(settings):
    known = {*Record.metadata.tables, *ENGINE_TABLES}
    others = {"alembic_version", "sqlite_sequence", "dbos_migrations"}
    assert files.tables(settings.database_path) == known | others


class Cut(BaseException):
    pass


def test_a_restore_that_is_cut_off_is_ended_or_never_was(settings, migrated, tmp_path, monkeypatch):
    digest = with_model(settings)
    archive = tmp_path / "b.tar"
    write_backup(settings, archive, quiet)
    whole = Path.rename
    ends = []
    for at in range(1, 20):
        folder = tmp_path / f"cut{at}"
        old = settings.model_copy(update={"data_dir": folder})
        shutil.copytree(migrated, folder)
        old.weights_dir.mkdir()
        (old.weights_dir / "old.safetensors").write_bytes(b"old")
        done = []

        def cut_short(self, target, at=at, done=done):
            done.append(target)
            if len(done) == at:
                raise Cut
            return whole(self, target)

        monkeypatch.setattr(Path, "rename", cut_short)
        with contextlib.suppress(Cut):
            restore_backup(old, archive, quiet, force=True)
        monkeypatch.setattr(Path, "rename", whole)
        migrate(old)  # as the next start does
        names = [path.name for path in old.weights_dir.iterdir()]
        with sqlite3.connect(old.database_path) as connection:
            (models,) = connection.execute("SELECT count(*) FROM models").fetchone()
        ends.append((names, models))
        assert not (folder / "restored").exists()
        if len(done) < at:
            break
    never, ended = (["old.safetensors"], 0), ([f"{digest}.safetensors"], 1)
    assert ends[0] == never
    assert set(map(str, ends[1:])) == {str(ended)}
    assert len(ends) > 6
    assert finish_restore(settings.data_dir) is None


def test_nothing_is_restored_under_what_runs(settings, tmp_path):
    write_backup(settings, tmp_path / "b.tar", quiet)
    with (
        held_alone(settings.data_dir),
        pytest.raises(StartError, match=f"in use by `surefoot serve`, pid {os.getpid()}"),
    ):
        restore_backup(settings, tmp_path / "b.tar", quiet, force=True)


def test_a_key_of_the_environment_is_not_in_the_archive_and_is_asked_for(settings, tmp_path):
    key = base64.b64encode(secrets.token_bytes(32)).decode()
    ours = settings.model_copy(update={"secret_key": key, "data_dir": tmp_path / "ours"})
    migrate(ours)
    hook(ours)
    assert write_backup(ours, tmp_path / "b.tar", quiet).key == "environment"
    assert key.encode() not in (tmp_path / "b.tar").read_bytes()
    fresh = ours.model_copy(update={"data_dir": tmp_path / "fresh"})
    without = fresh.model_copy(update={"secret_key": None})
    with pytest.raises(StartError, match="made with SUREFOOT_SECRET_KEY, id [0-9a-f]{8}; set it"):
        restore_backup(without, tmp_path / "b.tar", quiet, force=False)
    restore_backup(fresh, tmp_path / "b.tar", quiet, force=False)
    migrate(fresh)


def test_a_damaged_database_gives_no_backup(settings, tmp_path):
    with_model(settings)
    with settings.database_path.open("r+b") as file:
        file.seek(20 * 4096)
        file.write(b"\xa5" * 40_960)
    with pytest.raises(StartError, match="is damaged"):
        write_backup(settings, tmp_path / "b.tar", quiet)
    assert list(tmp_path.glob("*.tar")) == []
    assert [one.verdict for one in check_data_dir(settings)].count("fault") >= 1


@pytest.mark.slow
def test_the_commands_on_a_service_that_runs(service, tmp_path):
    wait_for(service.ready)
    service.http.post("/cameras", json=CAMERA).raise_for_status()
    tracks = [track(str(n), start_s=time.time() - 600 + n) for n in range(10)]
    batch = {"source": "t", "tracks": tracks}
    assert service.http.post("/cameras/corner/tracks", json=batch).json()["accepted"] == 10

    def run(*words, code=0):
        environment = {**service.settings.as_environment(), "COLUMNS": "300"}  # of its tables
        with tempfile.TemporaryDirectory() as folder:
            ended = forked.run(words, environment, Path(folder), timeout_s=60)
        assert ended.returncode == code, ended.stderr + ended.stdout
        return ended.stdout + ended.stderr

    archive = str(tmp_path / "b.tar")
    assert "schema 2026" in run("backup", archive)
    assert "exists already" in run("backup", archive, code=1)
    assert "in use by serve, pid" in run("check")
    assert "in use by `surefoot serve`, pid" in run("restore", archive, "--force", code=1)
    other = {**CAMERA, "id": "later"}
    service.http.post("/cameras", json=other).raise_for_status()
    service.stop()
    assert "What was there before is in" in run("restore", archive, "--force")
    service.start_again()
    assert service.http.get("/cameras/corner").status_code == 200
    assert service.http.get("/cameras/later").status_code == 404
