"""A command in a process of its own, forked off one in which python has imported it already.

Importing is most of what a command takes that refuses to start; `python -m service.cli` itself is
run by the slow tests.
"""

import multiprocessing
import os
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


def run(
    words: Sequence[str], environment: Mapping[str, str], folder: Path, timeout_s: float
) -> Ended:
    """Run `surefoot` with these words; what it prints goes by files in a folder."""
    printed = [folder / "stdout", folder / "stderr"]
    process = _FORKSERVER.Process(target=_surefoot, args=(words, dict(environment), printed))
    process.start()
    process.join(timeout_s)
    if process.exitcode is None:
        process.kill()
        process.join()
    return Ended(process.exitcode, *(path.read_text() for path in printed))


def _surefoot(words: Sequence[str], environment: dict[str, str], printed: Sequence[Path]) -> None:
    for number, path in enumerate(printed, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["surefoot", *words]
    main()
