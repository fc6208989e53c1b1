"""The faults: each is done, and undone, before the next."""

import os
import random
import shutil
import sqlite3
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import psutil

from tests.faults import of_servers
from tests.faults.ledger import Ledger
from tests.faults.stand import Stand

DISK_MB = 400
_FULL_S, _LONGEST_FULL_S, _READ_ONLY_S, _CLOCK_S = 4.0, 24.0, 2.0, 6.0
_WEIGHTS_S = 90.0
_REFUSAL_S = 30.0
_REFUSAL_LINES = 3
_STARTING_S = 120.0
_HOUR_S = 3600


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault, and why it cannot happen here, if it cannot."""

    name: str
    do: Callable[[Stand, Ledger, random.Random], None]
    missing: Callable[[Stand], str | None] = lambda _: None


def mount_disk(stand: Stand) -> str | None:
    """Give the data a small file system of its own; says why that is not possible."""
    if os.environ.get("FAULTS_MOUNTS") != "private":
        return "no mount namespace of its own (root and unshare are needed)"
    size = f"size={DISK_MB}m"
    made = _mount("-t", "tmpfs", "-o", size, "faults", str(stand.disk))
    return None if not made.returncode else f"mount: {made.stderr.strip()}"


def full_disk(stand: Stand, ledger: Ledger, _: random.Random) -> None:
    """Nothing more can be written for some seconds."""
    ballast = stand.disk / "ballast"
    with ballast.open("wb", buffering=0) as file:
        for size in (2**20, 4096):
            try:
                while True:
                    file.write(b"\0" * size)
            except OSError:
                continue
    # The write-ahead log has room of its own, so the first refusal takes a moment.
    start, before = time.monotonic(), ledger.refusals()
    while time.monotonic() - start < _LONGEST_FULL_S:
        time.sleep(_FULL_S)
        if not stand.answers():
            ledger.problem("full disk: /healthz is not answered")
        if ledger.refusals() > before:
            break
    else:
        ledger.oddities["full disk: nothing was refused"] += 1
    ballast.unlink()


def read_only(stand: Stand, ledger: Ledger, _: random.Random) -> None:
    """The file system is read-only when the service comes back from a kill.

    A mount with files that are open for writing cannot be made read-only from outside, so the
    service is down for the moment in which that happens.
    """
    stand.stop(kill=True)
    before = stand.log.stat().st_size
    end = time.monotonic() + _REFUSAL_S
    while (made := _mount("-o", "remount,ro", str(stand.disk))).returncode:
        if time.monotonic() > end:
            ledger.problem(f"the run could not remount: {made.stderr.splitlines()[0]}")
            break
        time.sleep(0.2)  # somebody opens an alert
    stand.start()
    end = time.monotonic() + _REFUSAL_S
    while stand.refused() == 0 and not stand.answers() and time.monotonic() < end:
        time.sleep(0.3)
    time.sleep(_READ_ONLY_S)
    _look_for_tracebacks(stand, ledger, before, "read-only disk")
    _mount("-o", "remount,rw", str(stand.disk))


def clock_back(stand: Stand, ledger: Ledger) -> None:
    """The wall clock goes back an hour, and stays there; nothing is started anew after it."""
    stand.set_clock(-_HOUR_S)
    ledger.fault("clock back to the end")


def clock(stand: Stand, ledger: Ledger, _: random.Random) -> None:
    """The wall clock jumps an hour ahead, and back again to an hour before, and to what it was."""
    for ahead_s in (_HOUR_S, -_HOUR_S, 0):
        stand.set_clock(ahead_s)
        time.sleep(_CLOCK_S)
        if not stand.answers():
            ledger.problem(f"clock at {ahead_s:+d} s: /healthz is not answered")


def lost_weights(stand: Stand, ledger: Ledger, random_: random.Random) -> None:
    """A file of weights is gone; workers that hold it in memory are started anew."""
    end = time.monotonic() + _WEIGHTS_S
    while not (files := sorted(stand.settings.weights_dir.glob("*.safetensors"))):
        if time.monotonic() > end:
            break
        time.sleep(0.5)
    if not files:
        ledger.oddities["lost weights: none there yet"] += 1
        return
    random_.choice(files).unlink()
    for worker in stand.workers():
        worker.kill()
    time.sleep(2)


def hang(stand: Stand, ledger: Ledger, random_: random.Random) -> None:
    """A worker hangs, as in native code: it is to be ended and replaced."""
    workers = stand.workers()
    if not workers:
        ledger.oddities["hang: no worker there"] += 1
        return
    worker = random_.choice(workers)
    worker.suspend()
    # One that has not said yet that it lives is still being started: that may take a while.
    end = time.monotonic() + 3 * stand.settings.worker_lost_s + _STARTING_S
    while time.monotonic() < end:
        if not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE:
            return
        time.sleep(0.3)
    ledger.problem("a worker that hangs is not ended and replaced")
    worker.kill()


def corrupt(stand: Stand, ledger: Ledger) -> None:
    """Start on copies of the database with an overwritten page: each is refused, in a line.

    Runs last, over a service that was stopped.
    """
    source = stand.settings.database_path
    with sqlite3.connect(f"file:{source}?mode=ro", uri=True) as there:
        size = there.execute("PRAGMA page_size").fetchone()[0]
        (stored,) = there.execute("SELECT count(*) FROM tracks").fetchone()
        (page,) = there.execute("SELECT rootpage FROM sqlite_master WHERE name='tracks'").fetchone()
    for name, number in (("header", 1), ("tracks", page)):
        folder = stand.folder / f"corrupt-{name}"
        shutil.copytree(stand.settings.data_dir, folder)
        copy = folder / source.name
        sqlite3.connect(copy).execute("PRAGMA wal_checkpoint(TRUNCATE)").connection.close()
        with copy.open("r+b") as file:
            file.seek((number - 1) * size)
            file.write(b"\xa5" * size)
        _start_on(stand, ledger, folder, name, stored)
        shutil.rmtree(folder)


def _start_on(stand: Stand, ledger: Ledger, folder: Path, name: str, stored: int) -> None:
    changes = {"SUREFOOT_DATA_DIR": str(folder)}
    process = stand.command(**changes)
    ready, end = False, time.monotonic() + _REFUSAL_S
    while process.poll() is None and time.monotonic() < end and not ready:
        ready = stand.answers("/readyz")
        time.sleep(0.3)
    if process.poll() is None:
        if ready:
            ledger.problem(f"corrupt {name} page: it is served as ready, {stored} tracks at stake")
        process.terminate()
    output = process.communicate(timeout=30)[0].decode()
    lines = output.strip().splitlines()
    if "Traceback" in output or len(lines) > _REFUSAL_LINES:
        ledger.problem(
            f"corrupt {name} page: {len(lines)} lines are printed, the last {lines[-1]!r:.80}"
        )
    elif not ready and not process.returncode:
        ledger.problem(f"corrupt {name} page: ends with 0")
    ledger.fault(f"corrupt {name} page")


def _look_for_tracebacks(stand: Stand, ledger: Ledger, since: int, name: str) -> None:
    with stand.log.open("rb") as log:
        log.seek(since)
        text = log.read().decode(errors="replace")
    if "Traceback" in text:
        ledger.problem(f"{name}: a traceback of {len(text.splitlines())} lines at the start")


def _mount(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["mount", *words], capture_output=True, text=True, check=False)


def _disk(stand: Stand) -> str | None:
    if stand.database is not None:
        return "the data is not on the machines' disks"
    return None if stand.disk.is_mount() else "the data has no file system of its own"


def _server(stand: Stand) -> str | None:
    return None if stand.database is not None else "no server: --machines 2"


def _clock(stand: Stand) -> str | None:
    if stand.database is not None:
        return "the server's clock is not the machines'"
    return None if stand.has_clock else "no C compiler (cc) to make a clock with"


FAULTS = (
    Fault(name="full disk", do=full_disk, missing=_disk),
    Fault(name="read-only", do=read_only, missing=_disk),
    Fault(name="clock", do=clock, missing=_clock),
    Fault(name="lost weights", do=lost_weights),
    Fault(name="hang", do=hang),
    Fault(name="database crash", do=of_servers.restart, missing=_server),
    Fault(name="partition", do=of_servers.partition, missing=_server),
    Fault(name="read-only primary", do=of_servers.read_only, missing=_server),
)
