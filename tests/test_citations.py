"""Files that docs, docstrings and comments name are there."""

import ast
import io
import os
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import ROOT

# What we write ourselves; other endings are of data, of other programs or of the service's answers.
_FILE = re.compile(
    r"(?<![\w/:.*{-])((?:[\w.-]+/)*[\w-]+\.(?:py|md|js|css|html|svg|mako))(?![\w(*{])"
)
_FOLDER = re.compile(r"`((?:models|service|migrations|studies|docs|deploy|tests)/[\w/.-]*)`")
_LINK = re.compile(r"\]\((?!https?:)([^)\s]*)\)")
_COMMENT = re.compile(
    r"/\*.*?\*/|<!--.*?-->|\{#.*?#\}|(?<!:)//[^\n]*|(?<![&\w{])#[^\n{}]*", re.DOTALL
)

_NOT_OURS = {".venv", "build", "data", "__pycache__", ".pytest_cache", ".mypy_cache", ".hypothesis"}


def our_files() -> list[Path]:
    """Every file that is in the repository, or will be; none where this is no checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if listed.returncode:
        found = []
        for folder, names, files in os.walk(ROOT):
            names[:] = [name for name in names if name not in _NOT_OURS]
            found += [Path(folder, name).relative_to(ROOT) for name in files]
        return found
    return [Path(line) for line in listed.stdout.splitlines() if (ROOT / line).is_file()]


def words_of(path: Path) -> Iterator[str]:
    """What a file says in words: all of a page, docstrings and comments of code."""
    text = (ROOT / path).read_text()
    if path.suffix == ".md":
        yield text
    elif path.suffix == ".py":
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                yield ast.get_docstring(node) or ""
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                yield token.string
    else:
        yield from _COMMENT.findall(text)


def missing(path: Path, words: str) -> list[str]:
    """Files and folders that a text of a file names and that are nowhere."""
    gone = [name for name in _FILE.findall(words) if name.removeprefix("../") not in ENDS]
    gone += [name for name in _FOLDER.findall(words) if not (ROOT / name).exists()]
    if path.suffix == ".md":
        gone += [
            link
            for link in _LINK.findall(words)
            if link.split("#")[0] and not (ROOT / path.parent / link.split("#")[0]).exists()
        ]
    return gone


FILES = our_files()
# Every way to name a file: by its path, or by the end of it.
ENDS = {"/".join(path.parts[first:]) for path in FILES for first in range(len(path.parts))}
SPEAKING = [
    path
    for path in FILES
    if path.suffix in (".py", ".md", ".js", ".css", ".html", ".yml", ".yaml", ".service")
]


def test_cited_files_exist():
    gone = {
        path.as_posix(): found
        for path in SPEAKING
        if (found := [name for words in words_of(path) for name in missing(path, words)])
    }
    assert gone == {}


@pytest.mark.parametrize(
    "words", ["see `live.js`", "Source: `estimation.md`, 3.4", "`models/nowhere/`", "in gone/is.py"]
)
def test_a_file_that_is_not_there_is_found(words):
    assert missing(Path("README.md"), words)


def anchors(path: Path) -> set[str]:
    """The fragments by which headings of a page are reached, as GitHub makes them."""
    heads = re.findall(r"^#+ (.*)$", (ROOT / path).read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_links_to_headings_lead_there():
    for path in FILES:
        if path.suffix == ".md":
            for link in _LINK.findall((ROOT / path).read_text()):
                name, _, fragment = link.partition("#")
                if fragment:
                    page = (path.parent / name) if name else path
                    assert fragment in anchors(page), (path, link)
