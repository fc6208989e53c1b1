"""A process of ours before the system: its work, private files, a clean end, memory, niceness."""

import ctypes
import logging
import os
import resource
import signal
import sys
import threading
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

log = logging.getLogger("surefoot.worker")

_M_ARENA_MAX, _M_MMAP_THRESHOLD = -8, -3  # of glibc's mallopt
_PAGE_MB = 4096 / 2**20
_MMAP_FROM_BYTES = 256 * 1024


class WorkKind(StrEnum):
    """Trainings, or all but trainings; as `surefoot worker --only` says it."""

    ESTIMATE = "estimate"
    TRAIN = "train"


def settle_allocator() -> None:
    """Have freed memory go back to the system; does nothing without glibc."""
    try:
        libc = ctypes.CDLL("libc.so.6")
        # Jobs run in changing threads; glibc gives each up to an arena of its own, and keeps in
        # every one what its largest job needed.
        libc.mallopt(_M_ARENA_MAX, 2)
        # Fixed: left alone it grows to 32 MB. Then the buffers that oneDNN makes anew for each
        # length of walk lie in the heap and split it: a training grew from 435 to 959 MB in 160
        # steps, of which 600 were free; so it stays at 405.
        libc.mallopt(_M_MMAP_THRESHOLD, _MMAP_FROM_BYTES)
    except (OSError, AttributeError):
        log.info("allocator_unknown")


def give_back() -> None:
    """Return free memory in the middle of the heap to the system, where glibc can."""
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        return


def limit_memory(mb: float | None) -> None:
    """Have what this process allocates beyond so much fail where that is done; None: no limit.

    Without it the system ends the process, or another one, for what a single job wants.
    """
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = most if mb is None else int(mb * 2**20)
    if most != resource.RLIM_INFINITY:
        wanted = min(wanted, most)
    resource.setrlimit(resource.RLIMIT_DATA, (wanted, most))


def resident_mb() -> float:
    """The process's resident memory; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0
    return pages * _PAGE_MB


def yield_to_others(nice: int) -> None:
    """Set this process's niceness, where the system lets it; who started it may be nicer."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    except OSError as error:
        log.info("niceness_kept", extra={"wanted": nice, "why": str(error)})


def be_private() -> None:
    """From now on this process makes files that only its user can read."""
    os.umask(0o077)


def end_like_ctrl_c() -> None:
    """From now on the end of the terminal, or SIGTERM, ends this process as Ctrl-C does."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)


def at_end_of_stdin(do: Callable[[], object]) -> None:
    """Do something, in a thread, once stdin ends: who started this process holds the other end."""

    def follow() -> None:
        sys.stdin.buffer.read()
        do()

    threading.Thread(target=follow, daemon=True).start()


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
