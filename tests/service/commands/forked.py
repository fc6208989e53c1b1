"""A command in a process of its own, forked off one in which python has imported it already.

Importing is most of what a command takes that refuses to start, or that serves a single test;
`python -m service.cli` itself is run by the slow tests.
"""

import contextlib
import importlib
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from service.cli import main

_FORKSERVER = multiprocessing.get_context("forkserver")
_FORKSERVER.set_forkserver_preload(
    ["service.commands.serve", "service.commands.worker", "tests.service.commands.forked"]
)


@dataclass(frozen=True, slots=True)
class Ended:
    """What a command that has ended leaves."""

    returncode: int | None
    stdout: str
    stderr: str


class Forked:
    """A running command, with what tests ask of a `subprocess.Popen`."""

    def __init__(
        self, words: Sequence[str], environment: Mapping[str, str], stdout: Path, stderr: Path
    ) -> None:
        self._process = _FORKSERVER.Process(
            target=_surefoot, args=(words, dict(environment), [stdout, stderr])
        )
        self._process.start()

    @property
    def pid(self) -> int:
        assert self._process.pid is not None
        return self._process.pid

    def poll(self) -> int | None:
        """The exit status; None while it runs."""
        return self._process.exitcode

    def wait(self, timeout: float) -> int:
        """The exit status.

        Raises:
            TimeoutExpired: it still runs after so many seconds.
        """
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired("surefoot", timeout)
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self._process.terminate()

    def kill(self) -> None:
        self._process.kill()


def run(
    words: Sequence[str], environment: Mapping[str, str], folder: Path, timeout_s: float
) -> Ended:
    """Run `surefoot` with these words; what it prints goes by files in a folder."""
    printed = [folder / "stdout", folder / "stderr"]
    command = Forked(words, environment, *printed)
    try:
        status = command.wait(timeout_s)
    except subprocess.TimeoutExpired:
        command.kill()
        command.wait(timeout_s)
        status = None
    return Ended(status, *(path.read_text() for path in printed))


def _surefoot(words: Sequence[str], environment: dict[str, str], printed: Sequence[Path]) -> None:
    for number, path in enumerate(printed, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
    os.environ.clear()
    os.environ.update(environment)
    # As python itself does at its start.
    sys.path[:0] = environment.get("PYTHONPATH", "").split(os.pathsep)
    with contextlib.suppress(ImportError):
        importlib.import_module("sitecustomize")
    sys.argv = ["surefoot", *words]
    main()
