"""The language check of the gate: `.ci/language`."""

import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT

CLEAN = "The camera has moved. " * 100


def check(page: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run the check on one page with a text."""
    page.write_text(text)
    command = [sys.executable, ROOT / ".ci" / "language", page]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_language_check_lists_lines_with_marker_words_and_fails_above_the_budget(tmp_path):
    ended = check(tmp_path / "page.md", f"{CLEAN}\nPeople tell it, and nobody says so.\n")
    assert ended.returncode == 1
    assert f"{tmp_path / 'page.md'}:2: tell, nobody, says\n" in ended.stdout
    assert "7.4 per 1,000 of   407 words" in ended.stdout


def test_language_check_passes_within_the_budget(tmp_path):
    ended = check(tmp_path / "page.md", f"{CLEAN}\nIt stands.\n")
    assert ended.returncode == 0
    assert "  2.5 per 1,000 of   402 words" in ended.stdout


def test_language_check_skips_generated_parts_and_keeps_line_numbers(tmp_path):
    made = "<!-- Made by `python -m tests.reference --write`. -->\nPeople tell it.\n"
    whole = check(tmp_path / "page.md", made)
    assert whole.returncode == 0
    assert "of 0 words in all" in whole.stdout
    part = check(tmp_path / "page.md", f"{made}<!-- The end of what is made. -->\nIt stands.\n")
    assert part.returncode == 1
    assert f"{tmp_path / 'page.md'}:4: stands\n" in part.stdout
    assert ":2:" not in part.stdout


def test_language_check_reads_every_page_written_by_hand():
    command = [ROOT / ".ci" / "language"]
    printed = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    for page in ("README.md", "docs/start.md", "docs/guides/alerts.md", "docs/method/pose.md"):
        assert f" {page}\n" in printed
    for page in ("docs/results/protocol.md", "docs/reference/http.md"):
        assert f" {page}\n" not in printed
