"""Benchmarks are run by hand: here, that each can still be."""

import importlib

import pytest

from tests.conftest import ROOT

MODULES = sorted(path.stem for path in (ROOT / "tests" / "benchmarks").glob("[a-z]*.py"))


@pytest.mark.parametrize("name", MODULES)
def test_each_finds_all_that_it_is_made_of(name):
    importlib.import_module(f"tests.benchmarks.{name}")
