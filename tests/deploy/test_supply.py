"""What is installed is named to the byte, and what is promised about safety has a test."""

import ast
import re

import pytest

from tests.conftest import ROOT

LOCKS = sorted((ROOT / "deploy" / "lock").glob("*.txt"))
COMMANDS = sorted(path for path in (ROOT / ".ci").iterdir() if path.is_file())
SECURITY = (ROOT / "tests" / "security.md").read_text()


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.name)
def test_all_that_is_locked_is_exact_and_has_hashes(path):
    text = path.read_text().replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and line[0] not in "#-"]
    assert lines
    for line in lines:
        assert re.match(r"[A-Za-z0-9._-]+==[^ ,]+ ", line), line[:80]
        assert re.search(r" --hash=sha256:[0-9a-f]{64}\b", line), line[:80]


def test_tools_of_the_gate_are_exact():
    """They are no part of the lock: each has an environment of its own."""
    found = [
        word
        for path in COMMANDS
        for line in path.read_text().splitlines()
        if re.search(r"^[^#]*pip\"? install", line)
        and "-r " not in line
        and "--no-deps" not in line
        for word in line.split("install", 1)[1].split()
        if not word.startswith("-")
    ]
    assert {word.partition("==")[0] for word in found} >= {"cyclonedx-bom", "pip-audit"}
    assert [word for word in found if not re.fullmatch(r"[a-z-]+==[0-9.]+", word)] == []


def test_both_stages_of_the_image_are_of_one_base_that_can_be_given_by_digest():
    text = (ROOT / "Dockerfile").read_text()
    assert re.findall(r"^FROM (\S+)", text, re.MULTILINE) == ["$BASE", "$BASE"]
    assert 'LABEL org.opencontainers.image.base.name="$BASE"' in text


def test_each_promise_has_a_test_that_is_there():
    named, last = [], ""
    for path, test in re.findall(r"`([\w/]*(?:\.py)?)::(\w+)`", SECURITY):
        last = path or last
        named.append((last, test))
    assert len(named) >= 40
    for path, test in named:
        tree = ast.parse((ROOT / "tests" / path).read_text())
        assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test
    rows = [line for line in SECURITY.splitlines() if re.match(r"\| (?!Promised|-)", line)]
    assert [row for row in rows if "::test_" not in row] == []
