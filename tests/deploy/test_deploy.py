"""The unit, the compose file and the guides name what exists."""

import re
import shutil
import subprocess

import pytest
import yaml
from typer.testing import CliRunner

from service.cli import app
from service.data_dir import COMPILED
from service.settings import Settings
from tests.conftest import ROOT

UNIT = ROOT / "deploy" / "surefoot.service"
WORKER_UNIT = ROOT / "deploy" / "surefoot-worker@.service"
COMPOSE = ROOT / "deploy" / "compose.yaml"
GUIDES = sorted((ROOT / "docs" / "guides").glob("*.md"))
RETENTION = (ROOT / "docs" / "guides" / "backup.md").read_text().split("## Retention")[1]
SETTINGS = {f"SUREFOOT_{name.upper()}" for name in Settings.model_fields}
# Of the commands that ask a service, and of the shell that completes them.
OF_CLIENTS = {f"SUREFOOT_{name}" for name in ("TOKEN", "TOKEN_FILE", "URL", "COMPLETE")}


def test_settings_exist():
    for path in (UNIT, WORKER_UNIT, COMPOSE, *GUIDES):
        assert (
            set(re.findall(r"SUREFOOT_[A-Z_]*[A-Z]", path.read_text())) <= SETTINGS | OF_CLIENTS
        ), path
    named = {f"SUREFOOT{name}" for name in re.findall(r"`(?:SUREFOOT)?(_[A-Z_]+)`", RETENTION)}
    assert len(named) >= 10
    assert named <= SETTINGS
    assert {name for name in SETTINGS if name.startswith("SUREFOOT_KEEP")} <= named


def test_limits_that_are_told_are_the_defaults():
    defaults = Settings()
    told = (
        f"{defaults.keep_days:g} days, {defaults.keep_tracks:,}, {defaults.keep_mb:g} MiB",
        f"| {defaults.keep_estimates:,} |",
        f"| {defaults.keep_trainings} |",
        f"| {defaults.keep_references} of a camera |",
        f"| {defaults.keep_alerts_days / 365:g} years |",
        f"| {defaults.keep_events:,} |",
        f"| {defaults.keep_deliveries_days:g} days |",
    )
    for words in told:
        assert words in RETENTION


def test_commands_exist():
    text = "".join(path.read_text() for path in (UNIT, WORKER_UNIT, *GUIDES))
    commands = set(re.findall(r"(?:`|/bin/|    )surefoot ([a-z-]+)", text))
    assert {"serve", "backup", "restore", "check", "rotate-key"} <= commands
    for command in commands:
        described = CliRunner().invoke(app, [command, "--help"])
        assert described.exit_code == 0, command


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_takes_the_units(tmp_path):
    for unit in (UNIT, WORKER_UNIT):
        text = unit.read_text().replace("/opt/surefoot/bin/surefoot", "/bin/true")
        (tmp_path / unit.name).write_text(text)
    checked = subprocess.run(
        ["systemd-analyze", "verify", str(tmp_path / UNIT.name)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (checked.returncode, checked.stderr) == (0, "")


@pytest.mark.parametrize("unit", [UNIT, WORKER_UNIT])
def test_the_unit_restarts_limits_and_hardens(unit):
    lines = set(unit.read_text().splitlines())
    assert {
        "Restart=always",
        "UMask=0077",
        "NoNewPrivileges=true",
        "ProtectSystem=strict",
        "StateDirectory=surefoot",
    } <= lines
    assert any(line.startswith("MemoryMax=") for line in lines)


def test_what_is_compiled_has_a_place_that_can_be_written():
    unit = UNIT.read_text()
    assert "Environment=NUMBA_CACHE_DIR=/var/cache/surefoot\n" in unit
    assert "\nCacheDirectory=surefoot\n" in unit  # /var/cache/surefoot
    image = (ROOT / "Dockerfile").read_text()
    assert f"NUMBA_CACHE_DIR=/data/{COMPILED} " in image


def test_the_container_restarts_limits_and_is_watched():
    services = yaml.safe_load(COMPOSE.read_text())["services"]
    assert services["worker"]["volumes"] == services["surefoot"]["volumes"]
    service = services["surefoot"]
    assert service["restart"] == "always"
    assert service["mem_limit"]
    assert service["pids_limit"]
    assert (COMPOSE.parent / service["build"]["context"] / "Dockerfile").exists()
    environment = service["environment"]
    assert {f"data:{environment['SUREFOOT_DATA_DIR']}"} == set(service["volumes"])
    (published,) = service["ports"]
    assert published.startswith("127.0.0.1:")
    assert published.endswith(f":{environment['SUREFOOT_PORT']}")
    probe = service["healthcheck"]["test"]
    assert probe[:3] == ["CMD", "python", "-c"]
    compile(probe[3], "healthcheck", "exec")
    assert f":{environment['SUREFOOT_PORT']}/readyz" in probe[3]
