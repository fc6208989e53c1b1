"""Benchmarks are run by hand: here, that each can still be."""

import importlib
import sys

import pytest

from tests.benchmarks import __main__ as every
from tests.conftest import ROOT

HERE = ROOT / "tests" / "benchmarks"
MODULES = sorted(
    ".".join(path.relative_to(HERE).with_suffix("").parts)
    for path in HERE.rglob("*.py")
    if path.name != "__init__.py" and path != HERE / "__main__.py"
)


@pytest.mark.parametrize("name", MODULES)
def test_each_finds_all_that_it_is_made_of(name):
    importlib.import_module(f"tests.benchmarks.{name}")


def test_one_command_runs_those_that_there_are(monkeypatch, capsys):
    assert set(every.BENCHMARKS) < set(MODULES)
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "runs,rusn"])
    with pytest.raises(SystemExit):
        every.main()
    assert "got rusn" in capsys.readouterr().err
