"""How far a process yields: the API first, then what workers compute, then trainings."""

import logging
import os

log = logging.getLogger("surefoot.worker")


def yield_to_others(nice: int) -> None:
    """Set this process's niceness, where the system lets it; who started it may be nicer."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    except OSError as error:
        log.info("niceness_kept", extra={"wanted": nice, "why": str(error)})
