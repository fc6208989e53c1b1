"""The README and the pages behind it are true."""

import json
import math
import re
import shutil
import statistics
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from typer.testing import CliRunner

from service.api.alerts import AlertOut
from service.cli import app
from service.settings import Settings
from tests.conftest import ROOT
from tests.running import RunningService, free_port

README = (ROOT / "README.md").read_text()
CONCEPTS = (ROOT / "docs" / "concepts.md").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HOST = "http://127.0.0.1:8080"
COMMANDS = (
    "serve", "worker", "migrate", "replay", "demo", "backup", "restore", "check", "rotate-key",
    "token", "migrate-data", "bridge", "status", "cameras", "alerts", "ack", "tail",
)  # fmt: skip


def blocks(language: str, page: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def samples(page: str = README) -> list[dict]:
    return [json.loads(text) for text in blocks("json", page)]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[str]:
    """The address of a real `surefoot serve`."""
    settings = Settings(data_dir=tmp_path / "data", workers=0, port=free_port())
    running = RunningService(settings, forked=False)
    running.start()
    yield running.url
    running.stop()


def curl(command: str, url: str) -> str:
    """Output of a command of the README, sent to another address; an HTTP error fails."""
    sent = command.replace(HOST, url).replace("curl ", "curl --fail-with-body -m 60 ", 1)
    ended = subprocess.run(["bash", "-c", sent], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, (sent, ended)
    return ended.stdout


def test_readme_has_at_most_10_kib():
    assert len(README.encode()) <= 10 * 1024


def test_readme_and_citation_have_the_version_of_the_project():
    assert f"/badge/version-{PROJECT['version']}-" in README
    assert f"surefoot-{PROJECT['version']}-py3-none-any.whl" in README
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert {"cff-version", "message", "title", "authors"} <= set(citation)


def test_readme_python_is_the_beginning_of_the_tested_example():
    (example,) = blocks("python")
    (start,) = blocks("python", (ROOT / "docs" / "start.md").read_text())
    assert start.startswith(example)


def test_measured_results_of_the_readme_are_in_the_results_pages():
    rows = README.split("## Measured results")[1].split("\n## ")[0]
    pages = {"a": "paper", "b": "protocol", "c": "alarms", "d": "parts"}
    checked = 0
    for row in rows.splitlines():
        if found := re.fullmatch(r"\|.*\|(.*)\| \[([a-d])\] \|", row):
            page = (ROOT / "docs" / "results" / f"{pages[found[2]]}.md").read_text()
            for number in re.findall(r"\d+\.\d+", found[1]):
                assert re.search(rf"\b{re.escape(number)}\b", page), (number, found[2])
                checked += 1
    assert checked >= 25


def test_time_to_an_alert_is_of_the_long_replays():
    protocol = (ROOT / "docs" / "results" / "protocol.md").read_text()
    for name, moved in (("tilt", "tilt"), ("roll", "roll"), ("pan", "pan")):
        rows = re.findall(rf"^\| [\w-]+ \| {moved} by 2 deg \|.*$", protocol, re.MULTILINE)
        people = [int(row.split("|")[13]) for row in rows]
        assert len(people) == 6
        middle = math.floor(statistics.median(people) + 0.5)
        assert f"{name} {middle} ({min(people)} to {max(people):,})" in README


def test_two_commands_do_all_the_set_up():
    section = README.split("## Try it")[1].split("\n## ")[0]
    demo, tests = [line.strip() for line in section.splitlines() if line.startswith("    ")]
    assert demo == ".ci/install && .venv/bin/surefoot demo"
    assert tests == ".ci/install test && .venv/bin/pytest"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl here")
def test_requests_of_the_readme_get_its_answers(service):
    requests = [
        command
        for block in blocks("sh")
        for command in re.split(r"\n(?=curl )", block.strip())
        if command.startswith("curl ")
    ]
    register, post, pose = requests
    assert json.loads(curl(register, service))["id"] == "town-centre"
    posted, served = samples()
    assert json.loads(curl(post, service)) == posted
    assert_like(served, json.loads(curl(pose, service)))


def test_alert_of_the_concepts_page_has_fields_of_the_api():
    (alert,) = samples(CONCEPTS)
    assert set(alert) <= set(AlertOut.model_fields)


def assert_like(sample: dict, answer: dict) -> None:
    """Every field of a sample is in the answer."""
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
    extras = PROJECT["optional-dependencies"]
    torch = {name: locked(f"torch-{name}.txt")["torch"] for name in ("cpu", "cuda")}
    runtime, everything = locked("runtime.txt"), locked("test.txt")
    assert torch["cpu"] == torch["cuda"]
    assert runtime.items() <= everything.items()
    for asked, there in (
        (PROJECT["dependencies"], runtime),
        (extras["plots"] + extras["test"] + extras["docs"], everything),
    ):
        for text in asked:
            wanted = Requirement(text)
            releases = (there | {"torch": torch["cpu"]})[wanted.name.lower()]
            assert all(wanted.specifier.contains(release) for release in releases), text
