"""Compiled functions: as Python has them, kept between processes, and outdated by any source."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import models
from models.compiled import compiled

OUTER = """
from models.compiled import compiled
from models.inner import LIMIT, doubled

@compiled
def total(values: list) -> float:
    found = 0.0
    for value in values:
        found += min(doubled(value), LIMIT)
    return found
"""
INNER = """
from models.compiled import compiled
LIMIT = {limit}

@compiled
def doubled(value: float) -> float:
    return {factor} * value
"""
ASK = """
import numpy, sys
import models.outer
assert "numba" not in sys.modules
print(models.outer.total(numpy.arange(4.0)))
stats = models.outer.total.made().stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
print(models.compiled._folder() or "")
"""


@pytest.fixture
def ask(tmp_path):
    return asking(tmp_path)


def asking(folder):
    package = folder / "models"
    package.mkdir(parents=True)
    for name in ("__init__.py", "compiled.py", "code_files.py", "effort.py"):
        shutil.copy(Path(models.__path__[0]) / name, package)
    (package / "outer.py").write_text(OUTER)

    def ask(environment=None, first="", **numbers):
        (package / "inner.py").write_text(INNER.format(**numbers))
        command = [sys.executable, "-c", f"{first}\n{ASK}"]
        told = subprocess.run(
            command,
            cwd=folder,
            env=environment or {**os.environ, "NUMBA_CACHE_DIR": str(folder / "code")},
            capture_output=True,
            text=True,
            check=True,
        )
        total, cached, place = told.stdout.splitlines()
        ask.place = Path(place)
        return float(total), cached

    return ask


def test_another_process_finds_the_code_unless_any_source_has_changed(ask):
    assert ask(factor=2, limit=5) == (2 + 4 + 5, "0 1")
    assert ask(factor=2, limit=5) == (2 + 4 + 5, "1 0")
    assert ask(factor=3, limit=7) == (3 + 6 + 7, "0 1")


def test_a_copy_of_the_sources_finds_the_code(ask, tmp_path):
    shared = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "code")}
    assert ask(shared, factor=2, limit=5) == (11, "0 1")
    assert asking(tmp_path / "copy")(shared, factor=2, limit=5) == (11, "1 0")


def test_no_code_is_kept_among_sources(ask, tmp_path):
    usual = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    ask(usual, factor=2, limit=5)
    try:
        assert list(ask.place.glob("*.nbc"))
        assert not ask.place.is_relative_to(tmp_path)
        assert not list(tmp_path.rglob("*.nb?"))
    finally:
        shutil.rmtree(ask.place)


def test_code_of_former_sources_is_removed_beside_new_code(ask, tmp_path):
    old, new, other = (tmp_path / "code" / name for name in ("surefoot-old", "surefoot-new", "x"))
    for folder in (old, new, other):
        folder.mkdir(parents=True)
    for folder in (old, other):
        os.utime(folder, (0, 0))
    ask(factor=2, limit=5)
    assert not old.exists()
    assert new.exists()
    assert other.exists()


def cut_off(whole):
    return whole[: len(whole) // 2]


def emptied(whole):
    return b""


def with_one_other_byte(whole):
    return whole[:-100] + bytes([whole[-100] ^ 1]) + whole[-99:]


@pytest.mark.parametrize("damage", [cut_off, emptied, with_one_other_byte])
def test_code_that_a_crash_has_damaged_is_compiled_anew_once(ask, damage):
    assert ask(factor=2, limit=5) == (11, "0 1")
    files = sorted(ask.place.rglob("*.nbc"))
    assert len(files) == 2  # of the function and of what it calls
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    assert ask(factor=2, limit=5) == (11, "0 1")
    assert ask(factor=2, limit=5) == (11, "1 0")
    assert sorted(ask.place.rglob("*.nbc")) == files


def test_code_that_others_may_have_written_is_not_run(ask, tmp_path):
    users = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "users")}
    first = "import sys; sys.prefix = sys.base_prefix"
    given = {**users, "NUMBA_CACHE_DIR": str(tmp_path / "code")}
    assert ask(given, first, factor=2, limit=5) == (11, "0 1")
    folder = ask.place
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)
    assert ask(given, first, factor=2, limit=5) == (11, "0 1")
    assert ask.place.is_relative_to(tmp_path / "users")


def test_a_full_disk_keeps_nobody_from_computing(tmp_path):
    pytest.importorskip("resource")
    body = """
import numpy, resource, signal
from models.compiled import compiled

@compiled
def twice(x):
    return 2 * x

twice.made()
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
assert twice(3.0) == 6.0
"""
    (tmp_path / "small.py").write_text(body)
    path = str(Path(models.__path__[0]).parent)
    code = tmp_path / "code"
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(code)}
    command = [sys.executable, str(tmp_path / "small.py")]
    subprocess.run(command, env=environment, check=True, timeout=120)
    assert not [file for file in code.rglob("*") if file.is_file()]


def test_where_nothing_can_be_written_each_process_compiles_for_itself(ask, tmp_path):
    (tmp_path / "file").touch()
    nowhere = {"HOME": "/dev/null", "NUMBA_CACHE_DIR": str(tmp_path / "file")}
    assert (
        ask(
            {**os.environ, **nowhere}, "import sys; sys.prefix = sys.base_prefix", factor=2, limit=5
        )[0]
        == 11
    )
    assert not list(tmp_path.rglob("*.nb?"))


def test_what_divides_by_nothing_goes_on_as_numpy_does():
    @compiled
    def ratio(first, second):
        return first / second

    assert ratio(1.0, 0.0) == np.inf
    assert ratio.__name__ == "ratio"


def test_what_is_not_of_this_project_is_compiled_too(tmp_path):
    text = "from models.compiled import compiled\n\n\n@compiled\ndef twice(x):\n    return 2 * x\n"
    (tmp_path / "elsewhere.py").write_text(f"{text}\n\nprint(twice(3.0))\n")
    path = str(Path(models.__path__[0]).parent)
    usual = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    told = subprocess.run(
        [sys.executable, str(tmp_path / "elsewhere.py")],
        env={**usual, "PYTHONPATH": path, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert float(told.stdout) == 6.0
