"""What keeps a command from starting is one line that says what to do; the commands are real."""

import contextlib
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import httpx
import psutil
import pytest

from tests.running import free_port, pid_exists, wait_for
from tests.service.commands import forked
from tests.stores.databases import only_sqlite


def start(command, data_dir, *flags, code=1, **variables):
    """The one line that a command ends with."""
    environment = {**os.environ, "SUREFOOT_DATA_DIR": str(data_dir), "SUREFOOT_PORT": "0"}
    with tempfile.TemporaryDirectory() as folder:
        words = [command, *flags]
        ended = forked.run(words, {**environment, **variables}, Path(folder), timeout_s=60)
    assert ended.returncode == code, ended.stderr
    lines = ended.stderr.splitlines()
    assert len(lines) == 1, ended.stderr
    assert lines[0].startswith("surefoot: ")
    assert not ended.stdout
    return lines[0].removeprefix("surefoot: ")


@pytest.mark.parametrize(
    ("variable", "value", "told"),
    [
        ("PORT", "abc", "SUREFOOT_PORT: .*integer.*, got 'abc'"),
        ("PORT", "70000", "SUREFOOT_PORT: .*65535, got '70000'"),
        ("RECIPE", "soup", "SUREFOOT_RECIPE: .*'default' or 'paper', got 'soup'"),
        ("WEBHOOK_ALLOW", "10.0.0.0/99", "SUREFOOT_WEBHOOK_ALLOW: .*'10.0.0.0/99'"),
        ("TIMEZONE", "Mars/Base", "SUREFOOT_TIMEZONE: .*'Mars/Base'"),
        ("PUBLIC_URL", "a.example", "SUREFOOT_PUBLIC_URL: http://host:port .*, got 'a.example'"),
        ("KEEP_DAYS", "1e9", "SUREFOOT_KEEP_DAYS: at most 36500 is taken, got 1000000000.0"),
        ("KEEP_MB", "inf", "SUREFOOT_KEEP_MB: at most 2147483647 is taken, got inf"),
        ("KEEP_EVENTS", "9" * 30, "SUREFOOT_KEEP_EVENTS: at most 2147483647 is taken, got 9{30}"),
        ("WEBHOOK_RETRY_S", "5,inf", "SUREFOOT_WEBHOOK_RETRY_S: numbers above 0, .*'5,inf'"),
        ("SECRET_KEY", "hunter2", "SUREFOOT_SECRET_KEY: 32 bytes in base64 .*openssl"),
    ],
)
def test_a_bad_setting_names_its_variable_its_limit_and_its_value(tmp_path, variable, value, told):
    command = {"PORT": "serve", "RECIPE": "worker"}.get(variable, "migrate")
    line = start(command, tmp_path / "data", code=2, **{f"SUREFOOT_{variable}": value})
    assert re.fullmatch(told + ".*", line), line
    assert "hunter2" not in line
    assert not (tmp_path / "data").exists()


@contextlib.contextmanager
def taken_port():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_port_in_use_is_named(tmp_path):
    with taken_port() as port:
        line = start("serve", tmp_path / "data", SUREFOOT_PORT=str(port))
    assert f"port: cannot listen on 127.0.0.1, port {port} (Address already in use)" in line


def test_an_address_of_another_machine_is_named(tmp_path):
    line = start("serve", tmp_path / "data", "--host", "192.0.2.1")
    assert "port: cannot listen on 192.0.2.1" in line


def test_a_data_directory_that_is_a_file(tmp_path):
    (tmp_path / "data").write_text("")
    assert f"{tmp_path}/data is a file; name a folder" in start("serve", tmp_path / "data")
    assert "is a file" in start("migrate", tmp_path / "data" / "below")


@only_sqlite("damages the file")
@pytest.mark.parametrize("command", ["serve", "worker", "migrate"])
def test_a_newer_schema_is_not_touched(settings, command):
    with sqlite3.connect(settings.database_path) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '2031_01_01_later'")
    line = start(command, settings.data_dir)
    assert "revision 2031_01_01_later, newer than this release" in line
    assert "install the release that wrote it" in line


@only_sqlite("damages the file")
def test_a_database_that_is_none_or_damaged(settings):
    whole = settings.database_path.read_bytes()
    settings.database_path.write_bytes(b"not a database at all" * 1000)
    assert "surefoot.sqlite is no SQLite database" in start("serve", settings.data_dir)
    settings.database_path.write_bytes(whole[:4096] + b"\xa5" * (len(whole) - 4096))
    assert "surefoot.sqlite is damaged" in start("migrate", settings.data_dir)


@only_sqlite("damages the file")
@pytest.mark.parametrize("table", ["tracks", "deliveries", "workflow_status"])
def test_a_table_that_is_damaged_is_not_served(settings, table):
    with contextlib.closing(sqlite3.connect(settings.database_path)) as connection:
        (size,) = connection.execute("PRAGMA page_size").fetchone()
        asked = "SELECT rootpage FROM sqlite_master WHERE name = ?"
        (page,) = connection.execute(asked, (table,)).fetchone()
    with settings.database_path.open("r+b") as file:
        file.seek((page - 1) * size)
        file.write(b"\xa5" * size)
    line = start("serve", settings.data_dir)
    assert "surefoot.sqlite is damaged" in line
    assert "surefoot restore" in line


@pytest.fixture
def small_disk(tmp_path):
    """A disk of two megabytes; where it cannot be made, the test is skipped."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(folder)],
        capture_output=True,
        check=False,
    )
    if made.returncode:
        pytest.skip("no right to mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_without_space(small_disk):
    data = small_disk / "data"
    with contextlib.suppress(OSError), (small_disk / "filler").open("wb") as filler:
        while True:
            filler.write(b"\0" * 4096)
            filler.flush()
    line = start("serve", data)
    assert "space" in line
    assert "make room" in line


def test_a_read_only_disk(small_disk, settings):
    shutil.copytree(settings.data_dir, small_disk / "data")
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    line = start("serve", small_disk / "data")
    assert "read-only" in line.lower() or "readonly" in line.lower()
    assert "writable" in line


@pytest.mark.slow
def test_one_serve_a_data_directory_and_workers_beside_it(service, tmp_path):
    wait_for(service.ready)
    line = start("serve", service.settings.data_dir)
    assert (
        f"{service.settings.data_dir} is in use by `surefoot serve`, pid {service.process.pid}"
        in (line)
    )
    assert service.ready()
    (log := tmp_path / "beside.log").touch()
    words = ["worker", "--name", "beside"]
    beside = forked.Forked(words, service.settings.as_environment(), log, log)
    try:
        wait_for(lambda: "worker_started" in log.read_text())
    finally:
        beside.terminate()
        beside.wait(20)
    service.kill()  # what dies holds nothing
    service.start()


def test_a_demo_keeps_out_of_a_service_that_runs(tmp_path):
    with taken_port() as port:
        line = start("demo", tmp_path, "--port", str(port))
    assert f"port {port}" in line
    assert "another" in line


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGHUP, signal.SIGKILL])
def test_nothing_stays_of_a_demo_that_was_ended(tmp_path, end):
    port = free_port()
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    # A site's database and broker are nothing of its.
    environment["SUREFOOT_DATABASE_URL"] = "postgresql://nobody@127.0.0.1:1/site"
    environment["SUREFOOT_MQTT_URL"] = "mqtt://127.0.0.1:1"
    command = [sys.executable, "-m", "service.cli", "demo", "--port", str(port), "--no-stay"]
    demo = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    wait_for(lambda: _answers(port))
    (folder,) = tmp_path.glob("surefoot-demo-*")
    family = psutil.Process(demo.pid).children(recursive=True)
    assert family
    demo.send_signal(end)
    demo.wait(20)
    wait_for(lambda: not any(pid_exists(process.pid) for process in family), 30)
    if end == signal.SIGKILL:  # the next one finds it
        with taken_port() as other:
            start("demo", tmp_path, "--port", str(other), TMPDIR=str(tmp_path))
    assert not folder.exists()


def _answers(port):
    try:
        return httpx.get(f"http://127.0.0.1:{port}/healthz").status_code == 200
    except httpx.TransportError:
        return False


def test_a_site_is_moved_from_a_data_directory_to_a_server(tmp_path):
    from_, to = ("--from", f"sqlite:///{tmp_path}/none"), "postgresql://localhost:1/site"
    line = start("migrate-data", tmp_path, *from_, "--to", to)
    assert line == f"--from: {tmp_path}/none is no surefoot.sqlite of a data directory"
    line = start("migrate-data", tmp_path, *from_, "--to", "mysql://localhost/site")
    assert line.startswith("--to: postgresql://user:password@host:port/database is needed")
