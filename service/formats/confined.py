"""Files of strangers, read by libraries in C: each in a process of its own.

Such a process has little to lose and nothing to reach: of our environment it gets the way to the
modules, by the time that it looks at the file it can open no other and no connection, and it is
ended when it wants too much memory or time.
"""

import contextlib
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

from service.interpreter import command_of

MAX_SECONDS = 10.0
MAX_CPU_S = 5
MAX_MEMORY_BYTES = 1024 * 1024 * 1024  # above what the libraries have mapped already


class ReaderError(Exception):
    """A file broke its reader, or its limits; the message says how."""


def read_apart(reader: str, body: bytes, *said: str, within_s: float = MAX_SECONDS) -> bytes:
    """The answer of a reader, a module that is run, about a file.

    Raises:
        ReaderError: there is none.
    """
    # Of this process's environment, which may hold secrets, it gets nothing that is not needed.
    paths = [str(Path(__file__).parents[2]), *sys.path]
    environment = {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            # All paths are said, so `site` would only take a third of the time to find them again.
            command_of(reader, str(MAX_CPU_S), *said, options="S"),
            input=body,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            timeout=within_s,
            check=True,
        )
    except subprocess.TimeoutExpired as error:
        raise ReaderError(f"it was not read within {within_s:g} s") from error
    except subprocess.CalledProcessError as error:
        if error.returncode in (-signal.SIGKILL, -signal.SIGXCPU):
            raise ReaderError(f"reading it takes more than {MAX_CPU_S} s of a CPU") from error
        raise ReaderError(f"its reader ended over it with status {error.returncode}") from error
    return done.stdout


def give_up_rights(cpu_s: int = MAX_CPU_S) -> None:
    """Cap what this process, a reader, may still take. Once done, it cannot be undone."""
    with contextlib.suppress(FileNotFoundError):  # macOS has neither the file nor the limit
        with open("/proc/self/statm") as counts:
            mapped = int(counts.read().split()[0]) * resource.getpagesize()
        _cap(resource.RLIMIT_AS, mapped + MAX_MEMORY_BYTES)
    _cap(resource.RLIMIT_CPU, cpu_s)
    _cap(resource.RLIMIT_CORE, 0)
    _cap(resource.RLIMIT_FSIZE, 0)  # of files: pipes are none
    _cap(resource.RLIMIT_NOFILE, 0)  # no file and no socket more


def _cap(what: int, most: int) -> None:
    resource.setrlimit(what, (most, most))
