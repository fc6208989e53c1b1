"""The pages of `docs/reference/` and examples are what a command makes, and guides name all."""

import re

import pytest

from service.enums import AlertKind, PoseState
from service.settings import Settings
from tests.conftest import ROOT
from tests.reference import FILES


@pytest.mark.parametrize("path", list(FILES), ids=lambda path: path.name)
def test_a_file_is_what_its_command_makes(path):
    assert path.read_text() == FILES[path](), "python -m tests.reference --write"


def test_the_guide_says_what_each_state_and_kind_means():
    states, kinds = (ROOT / "docs" / "guides" / "alerts.md").read_text().split("## Kinds")
    assert set(re.findall(r"\| `(\w+)` \|", states)) == set(PoseState)
    assert set(re.findall(r"^\| `(\w+)` \|", kinds, re.MULTILINE)) == set(AlertKind)


def test_settings_that_pages_name_are_settings():
    """Those in capitals, with and without the prefix."""
    names = {name.upper() for name in Settings.model_fields}
    others = {"REACH", "NUMBA_CACHE_DIR", "TOKEN", "TOKEN_FILE", "SUREFOOT_URL"}  # of clients
    others |= {"HABITS", "HABITS_OF_DAYS", "VACUUM"}  # of models, of SQLite
    for page in sorted((ROOT / "docs").rglob("*.md")):
        named = re.findall(r"`(?:SUREFOOT)?_?([A-Z][A-Z_]{2,}[A-Z])`", page.read_text())
        assert {name for name in named if not name.startswith("TEST_")} <= names | others, page
