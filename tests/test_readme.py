"""What the README and the pages behind it say is so."""

import json
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

from service.api.alerts import AlertOut
from service.cli import app
from service.settings import Settings
from tests.conftest import ROOT
from tests.running import RunningService, free_port

README = (ROOT / "README.md").read_text()
HOST = "http://127.0.0.1:8080"
COMMANDS = (
    "serve", "worker", "migrate", "replay", "demo", "backup", "restore", "check", "rotate-key",
    "token", "migrate-data", "bridge", "status", "cameras", "alerts", "ack", "tail",
)  # fmt: skip


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def samples() -> list[dict]:
    return [json.loads(text) for text in blocks("json")]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[str]:
    """The address of a real `surefoot serve`."""
    settings = Settings(data_dir=tmp_path / "data", workers=0, port=free_port())
    running = RunningService(settings, forked=False)
    running.start()
    yield running.url
    running.stop()


def curl(command: str, url: str) -> str:
    """What a command of the README prints, asked of another address; an error of HTTP fails."""
    limit_s = 5 if "/events" in command else 60
    told = command.replace(HOST, url).replace("curl ", f"curl --fail-with-body -m {limit_s} ", 1)
    asked = subprocess.run(["bash", "-c", told], capture_output=True, text=True, check=False)
    # A stream ends by our limit of time alone.
    assert asked.returncode == (28 if "/events" in command else 0), (told, asked)
    return asked.stdout


def test_the_readme_is_short():
    assert len(README.encode()) <= 7 * 1024


def test_two_commands_do_all_the_set_up():
    section = README.split("## Try it")[1].split("\n## ")[0]
    demo, tests = [line.strip() for line in section.splitlines() if line.startswith("    ")]
    assert demo == ".ci/install && .venv/bin/surefoot demo"
    assert tests == ".ci/install test && .venv/bin/pytest"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl here")
def test_its_requests_are_answered_as_it_says(service):
    requests = [
        command
        for block in blocks("sh")
        for command in re.split(r"\n(?=curl )", block.strip())
        if command.startswith("curl ")
    ]
    register, post, pose, alerts, events = requests
    assert json.loads(curl(register, service))["id"] == "town-centre"
    posted, served, alert = samples()
    assert json.loads(curl(post, service)) == posted
    assert_like(served, json.loads(curl(pose, service)))
    assert json.loads(curl(alerts, service))["items"] == []
    assert set(alert) <= set(AlertOut.model_fields)
    assert ": connected" in curl(events, service)


def assert_like(sample: dict, answer: dict) -> None:
    """Whatever a sample has is in the answer, too."""
    for name, value in sample.items():
        assert name in answer
        if isinstance(value, dict) and isinstance(answer[name], dict):
            assert_like(value, answer[name])


def test_its_commands_exist():
    described = CliRunner().invoke(app, ["--help"]).output
    guides = sorted((ROOT / "docs" / "guides").glob("*.md"))
    pages = README + "".join(page.read_text() for page in guides)
    for name in COMMANDS:
        assert name in described
        assert f"surefoot {name}" in pages
    for name in re.findall(r"(?:bin/|surefoot |`)surefoot ([a-z][a-z-]+)", pages):
        assert name in COMMANDS


def locked(name: str) -> dict[str, list[str]]:
    """Releases that a lock file has of each package, after checking that each has hashes."""
    found: dict[str, list[str]] = {}
    for block in re.split(r"\n(?=[a-z])", (ROOT / "deploy/lock" / name).read_text()):
        if block.startswith(("#", "-")):
            continue
        package, version = re.match(r"([a-z0-9.-]+)==([^ ]+)", block).groups()
        found.setdefault(package, []).append(version)
        assert "--hash=sha256:" in block, package
    return found


def test_the_lock_fits_what_the_project_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    torch = {name: locked(f"torch-{name}.txt")["torch"] for name in ("cpu", "cuda")}
    runtime, everything = locked("runtime.txt"), locked("test.txt")
    assert torch["cpu"] == torch["cuda"]
    assert runtime.items() <= everything.items()
    for asked, there in (
        (project["dependencies"], runtime),
        (extras["plots"] + extras["test"] + extras["docs"], everything),
    ):
        for text in asked:
            wanted = Requirement(text)
            releases = (there | {"torch": torch["cpu"]})[wanted.name.lower()]
            assert all(wanted.specifier.contains(release) for release in releases), text
