"""The folder and the port of a demo: its own alone, and gone afterwards."""

import contextlib
import fcntl
import shutil
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

from service.data_dir import StartError, running_in

_PREFIX, _LOCK = "surefoot-demo-", "demo.lock"
_HOST = "127.0.0.1"


@contextlib.contextmanager
def demo_folder() -> Iterator[Path]:
    """A folder that is removed at the end; by its lock others see that a demo is in it."""
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as name,
        (Path(name) / _LOCK).open("w") as lock,
    ):
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield Path(name)


def remove_left_over() -> None:
    """Remove the folders of demos that were killed, once nothing runs in them."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        # Without the lock it is somebody else's, or is just being made.
        with contextlib.suppress(OSError):
            if (folder / _LOCK).exists() and not running_in(folder):
                shutil.rmtree(folder)


def require_free(port: int) -> None:
    """Check that nobody listens on a port of this machine.

    Raises:
        StartError: somebody does; the demo would register its street there.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, port))
        except OSError as error:
            raise StartError(
                f"port: {_HOST}, port {port} cannot be had ({error.strerror}); another service "
                "runs there: name another port by --port, or none"
            ) from error


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        port: int = probe.getsockname()[1]
        return port
