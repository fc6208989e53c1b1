"""What may fail beside the served estimate: each failure is logged and said, and stops nobody."""

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from models.errors import CheckpointError
from models.pose.partial_failures import PartialFailure, unless_failed
from models.reasons import Reason
from service.reasons import ServiceCode

log = logging.getLogger("surefoot.recalibration")

_Made = TypeVar("_Made")


class Lacks:
    """What of a camera's estimate could not be made; `said` has it as reasons."""

    def __init__(self, camera_id: str) -> None:
        self._camera_id = camera_id
        self.said: list[Reason] = []

    def unless_failed(self, what: str, make: Callable[[], _Made]) -> _Made | None:
        """What is made; None if it failed. `what` is of the log's event, `flow_map` say."""
        found: list[PartialFailure] = []
        made = unless_failed(found, what, make)
        self.take(found)
        return made

    def take(self, found: Sequence[PartialFailure]) -> None:
        """Log and say what failed."""
        for lack in found:
            fields = {"camera_id": self._camera_id}
            if isinstance(lack.error, CheckpointError):
                log.warning(f"{lack.part}_unreadable", extra=fields | {"why": str(lack.error)})
                self.add(lack.part, "cannot be read")
            else:
                log.error(f"{lack.part}_failed", exc_info=lack.error, extra=fields)
                self.add(lack.part, repr(lack.error))

    def add(self, what: str, why: str) -> None:
        """Say that something is missing, and why."""
        reason = Reason(code=ServiceCode.WITHOUT_PART, values={"part": what, "why": why})
        if reason not in self.said:
            self.said.append(reason)
