"""What the README says is so."""

import json
import re
from pathlib import Path

from fastapi.testclient import TestClient
from typer.testing import CliRunner

from service.app import create_app
from service.cli import app

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def commands() -> list[str]:
    section = README.split("## Try it")[1].split("\n## ")[0]
    return [line.strip() for line in section.splitlines() if line.startswith("    ")]


def bodies() -> list[dict]:
    return [json.loads(text) for text in re.findall(r"-d '(\{.*?\})'", README, re.DOTALL)]


def test_two_commands_do_all_the_set_up():
    demo, tests = commands()
    for command in (demo, tests):
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install -q -c ")
    assert demo.endswith("surefoot demo")
    assert tests.endswith(".venv/bin/pytest")


def test_what_it_posts_is_taken(settings):
    camera, batch = bodies()
    with TestClient(create_app(settings)) as http:
        assert http.post("/cameras", json=camera).status_code == 201
        answer = http.post("/cameras/town-centre/tracks", json=batch)
        assert answer.json() == {"accepted": 1, "duplicates": 0, "rejected": []}
        for path in re.findall(r"http://127\.0\.0\.1:8080(/[^\s'>]*)", README):
            if path != "/events" and not path.startswith("/cameras/town-centre/tracks"):
                assert http.get(path).status_code == 200, path


def test_its_commands_exist():
    described = CliRunner().invoke(app, ["--help"]).output
    for name in set(
        re.findall(r"surefoot (serve|worker|migrate|replay|demo|evaluate|centred)", README)
    ):
        assert name in described
    for name in ("serve", "worker", "migrate", "replay", "demo", "evaluate", "centred"):
        assert f"surefoot {name}" in README


def test_its_files_exist():
    for link in re.findall(r"\]\(([^)#]+)\)", README):
        assert link.startswith("http") or (ROOT / link).is_file(), link
    for path in re.findall(r"`((?:service|models|tests)/[\w/.]*)`", README):
        assert (ROOT / path).exists(), path


def test_constraints_pin_what_the_project_asks_for():
    pinned = (ROOT / ".constraints.txt").read_text().lower()
    project = (ROOT / "pyproject.toml").read_text()
    for name, version in re.findall(r'^    "([\w-]+)==([\w.]+)"', project, re.MULTILINE):
        assert f"{name.lower()}=={version}" in pinned.replace("_", "-"), name
