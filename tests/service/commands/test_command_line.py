"""The command line before it does anything: what it says of itself, and imports for that."""

import os
import subprocess
import sys
from importlib.metadata import version

from tests.conftest import ROOT
from tests.service.commands import forked

# Each takes longer than python itself needs to start; numpy and sqlalchemy took 0.7 s.
HEAVY = {"numpy", "torch", "scipy", "numba", "cv2", "sqlalchemy", "pydantic", "fastapi", "httpx"}


def test_the_version_is_that_of_what_is_installed(tmp_path):
    ended = forked.run(["--version"], dict(os.environ), tmp_path, timeout_s=60)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == f"surefoot {version('surefoot')}\n"


def test_the_command_line_by_itself_imports_nothing_heavy():
    program = f"import sys, service.cli; print(sorted({HEAVY} & set(sys.modules)))"
    command = [sys.executable, "-c", program]
    output = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert output.stdout.strip() == "[]"
