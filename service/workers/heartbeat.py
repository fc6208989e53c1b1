"""A worker's sign of life: a line to `serve` every 2 s, as long as none of its jobs hangs.

What hangs in native code and holds the interpreter stops this thread too: the lines end, and
`serve` ends the process. What hangs without holding it goes beyond its limit, and is found here.
"""

import contextlib
import logging
import os
import sys
import threading

from service.workers.context import JobContext
from service.workers.processes import exits

log = logging.getLogger("surefoot.worker")

BEAT_S = 2.0


def start_heartbeat(context: JobContext, *, tells: bool) -> None:
    """Beat until the process ends; to stdout if `serve` listens there."""
    threading.Thread(target=_beat, args=(context, tells), name="heartbeat", daemon=True).start()


def _beat(context: JobContext, tells: bool) -> None:
    wait = threading.Event()
    while True:
        task = context.running.overdue()
        if task is not None:
            limit_s = context.running.limits_s[task.kind]
            fields = {"job": task.kind, "arguments": task.about, "limit_s": limit_s}
            log.error("job_hangs", extra=fields)
            logging.shutdown()
            os._exit(exits.HANGS)  # its thread cannot be ended otherwise
        if tells:
            # The other end is gone: so is `serve`, and the thread that follows stdin ends us.
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.buffer.write(b"beat\n")
                sys.stdout.buffer.flush()
        wait.wait(BEAT_S)
