"""Private files of our processes, and an end by signal that cleans up."""

import os
import signal


def be_private() -> None:
    """From now on this process makes files that only its user can read."""
    os.umask(0o077)


def end_like_ctrl_c() -> None:
    """From now on the end of the terminal, or SIGTERM, ends this process as Ctrl-C does."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
