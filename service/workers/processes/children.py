"""The life of a child process: started anew when it dies, later each time, and ended with us."""

import subprocess
import threading
import time
from collections.abc import Callable

SETTLED_S = 60.0  # who lives for so long did not die of how it starts
TICK_S = 0.2
_STOP_S = 10.0
_LONGEST_PAUSE_S = 60.0


def pause_s(deaths: int) -> float:
    """The pause before a process is started again that died so often in a row."""
    return float(min(2.0 ** min(deaths - 1, 20), _LONGEST_PAUSE_S))


def keep_alive(
    run: Callable[[int], int],
    tell: Callable[[int, int, float], bool],
    stopping: threading.Event,
) -> None:
    """Run a process again and again until the event is set.

    `run` is told how often it died in a row, and returns its exit status. `tell` is told of that
    and of the deaths, and when it is started again in s; it says whether it is to be.
    """
    deaths = 0
    while not stopping.is_set():
        begun_s = time.monotonic()
        status = run(deaths)
        if stopping.is_set():
            return
        deaths = 1 if time.monotonic() - begun_s > SETTLED_S else deaths + 1
        rest_s = pause_s(deaths)
        if not tell(status, deaths, rest_s):
            return
        stopping.wait(rest_s)


def ended(process: "subprocess.Popen[bytes]") -> int:
    """The exit status of a process that is to end; it is killed where it does not."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
    return process.wait()
