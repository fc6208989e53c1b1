"""The data directory: private to its owner, and held by one `serve` at a time."""

import contextlib
import errno
import fcntl
import logging
import os
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

log = logging.getLogger("surefoot.data_dir")

SERVE_LOCK, MIGRATE_LOCK, KEY_FILE = "serve.lock", "migrate.lock", "secret.key"
ROUNDS = "rounds"  # of the worker that does the upkeep, which has a lock of its own
ROUNDS_LOCK = f"{ROUNDS}.lock"
DATABASE, WEIGHTS, COPIES = "surefoot.sqlite", "weights", "copies"
BRIDGE = "bridge.sqlite"  # what the bridge has not posted yet
COMPILED = "compiled"  # in the image: machine code of models/, where no other place can be written
_OURS = (
    *(name + end for name in (DATABASE, BRIDGE) for end in ("", "-wal", "-shm", "-journal")),
    BRIDGE + ".damaged-*",
    *(WEIGHTS, COPIES, COMPILED, SERVE_LOCK, MIGRATE_LOCK, ROUNDS_LOCK, "worker-*.lock"),
    *(KEY_FILE, KEY_FILE + ".*", "restored", "restoring-*", "replaced-*"),
)


class StartError(Exception):
    """An obstacle to a command: one line that names it and says what to do."""


def make_private(folder: Path) -> None:
    """Make the data directory, or take the rights of others off what we keep in it.

    Of a folder that holds other things too, a home say, its own mode stays as it is.

    Raises:
        StartError: it cannot be made, written or changed.
    """
    with telling_of(folder):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        for top in _ours_in(folder):
            for path in (top, *(top.rglob("*") if top.is_dir() else ())):
                _narrow(path)
        if not strangers_in(folder):
            _narrow(folder)


def strangers_in(folder: Path) -> list[str]:
    """The names of what is in a data directory and not ours."""
    return sorted(path.name for path in set(folder.iterdir()) - _ours_in(folder))


def make_file(path: Path) -> None:
    """Make an empty file of this user alone, unless there is one.

    An empty file is an empty database, and all that SQLite puts beside it has its mode. One that is
    there is not opened: closing it would take the locks off that SQLite holds in this process.
    """
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600))


@contextlib.contextmanager
def held_alone(folder: Path) -> Iterator[None]:
    """Hold the data directory as the one `serve` of it, or as what must not run beside one.

    Raises:
        StartError: another process holds it; the message has its pid.
    """
    with contextlib.ExitStack() as stack:
        with telling_of(folder):
            lock = stack.enter_context((folder / SERVE_LOCK).open("a+"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise StartError(
                    f"data_dir: {folder} is in use by `surefoot serve`, pid {_read_pid(lock)}; "
                    "stop that one, or name another folder by --data-dir or SUREFOOT_DATA_DIR"
                ) from error
            lock.truncate(0)
            with contextlib.suppress(OSError):  # on a full disk it is held without its pid
                os.write(lock.fileno(), f"{os.getpid()}\n".encode())
        yield


def require_stopped(folder: Path) -> None:
    """Check that no worker uses a data directory that the caller holds alone.

    Raises:
        StartError: one does.
    """
    if workers := running_in(folder, but=(SERVE_LOCK,)):
        raise StartError(f"data_dir: {folder} is in use by {', '.join(workers)}; stop that first")


def running_in(folder: Path, but: tuple[str, ...] = ()) -> list[str]:
    """The processes that hold locks of a data directory: `serve, pid 17`, `worker local-0`."""
    found = []
    for path in sorted(folder.glob("*.lock")):
        if path.name in (MIGRATE_LOCK, ROUNDS_LOCK, *but):
            continue
        with path.open() as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                name = path.name.removesuffix(".lock")
                found.append(
                    f"serve, pid {_read_pid(lock)}"
                    if path.name == SERVE_LOCK
                    else name.replace("-", " ", 1)
                )
    return found


@contextlib.contextmanager
def telling_of(folder: Path) -> Iterator[None]:
    """Turn what the file system refuses into one line about a folder.

    Raises:
        StartError: instead of an `OSError`.
    """
    try:
        yield
    except OSError as error:
        raise StartError(_words(folder, error)) from error


def require_space(folder: Path, needed: int, what: str) -> None:
    """Check that bytes are free where a folder is.

    Raises:
        StartError: there are fewer.
    """
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise StartError(
            f"space: {what} needs {megabytes(needed)} in {folder}, {megabytes(free)} are free; "
            "make room and start again"
        )


def megabytes(size: int) -> str:
    """Bytes in words."""
    return f"{size / 1e6:.1f} MB"


def sync_folder(folder: Path) -> None:
    """Make the names in a folder survive a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _ours_in(folder: Path) -> set[Path]:
    return {path for pattern in _OURS for path in folder.glob(pattern)}


def _narrow(path: Path) -> None:
    """Take group's and others' rights off; what is not wider is left alone, and so are links."""
    with contextlib.suppress(FileNotFoundError):  # a service that runs deletes files meanwhile
        mode = path.stat(follow_symlinks=False).st_mode
        if mode & 0o077 and not stat.S_ISLNK(mode):
            path.chmod(mode & 0o700)
            log.info("made_private", extra={"path": str(path), "was": oct(mode & 0o7777)})


def _read_pid(lock: TextIO) -> str:
    lock.seek(0)
    return lock.read().strip() or "unknown"


def _words(folder: Path, error: OSError) -> str:
    where = error.filename or folder
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return f"data_dir: {where} is a file; name a folder by --data-dir or SUREFOOT_DATA_DIR"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return (
            f"data_dir: {where} cannot be written ({error.strerror}); it must be on a writable "
            f"disk and belong to this user, uid {os.getuid()}"
        )
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"space: none is left in {folder} ({error.strerror}); make room and start again"
    return f"data_dir: {where}: {error.strerror or error}"
