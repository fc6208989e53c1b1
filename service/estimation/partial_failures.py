"""Parts of an estimate that could not be made: logged, and named in the camera's reasons."""

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
    """The parts of a camera's estimate that could not be made, with their `reasons`."""

    def __init__(self, camera_id: str) -> None:
        self._camera_id = camera_id
        self.reasons: list[Reason] = []

    def unless_failed(self, part: str, make: Callable[[], _Made]) -> _Made | None:
        """Make a part; None if it failed. `part` names it in the log, for example `flow_map`."""
        found: list[PartialFailure] = []
        made = unless_failed(found, part, make)
        self.take(found)
        return made

    def take(self, found: Sequence[PartialFailure]) -> None:
        """Log failures and add their reasons."""
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
        """Add the reason of a missing part."""
        reason = Reason(code=ServiceCode.WITHOUT_PART, values={"part": part, "why": why})
        if reason not in self.reasons:
            self.reasons.append(reason)
