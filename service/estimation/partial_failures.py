"""Failures beside the served estimate: each is logged and said, and stops nobody."""

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from models.errors import CheckpointError
from models.pose import PartialFailure, unless_failed
from models.reasons import Reason
from service.reasons import ServiceCode

log = logging.getLogger("surefoot.recalibration")

_Made = TypeVar("_Made")


class PartialFailures:
    """The parts of a camera's estimate that could not be made; `reasons` say so."""

    def __init__(self, camera_id: str) -> None:
        self._camera_id = camera_id
        self.reasons: list[Reason] = []

    def unless_failed(self, part: str, make: Callable[[], _Made]) -> _Made | None:
        """Something made; None if it failed. `part` names it in the log, `flow_map` say."""
        found: list[PartialFailure] = []
        made = unless_failed(found, part, make)
        self.take(found)
        return made

    def take(self, found: Sequence[PartialFailure]) -> None:
        """Log and say what failed."""
        for failure in found:
            fields = {"camera_id": self._camera_id}
            if isinstance(failure.error, CheckpointError):
                log.warning(
                    f"{failure.part}_unreadable", extra=fields | {"why": str(failure.error)}
                )
                self.add(failure.part, "cannot be read")
            else:
                log.error(f"{failure.part}_failed", exc_info=failure.error, extra=fields)
                self.add(failure.part, repr(failure.error))

    def add(self, part: str, why: str) -> None:
        """Say that something is missing, and why."""
        reason = Reason(code=ServiceCode.WITHOUT_PART, values={"part": part, "why": why})
        if reason not in self.reasons:
            self.reasons.append(reason)
