"""What may fail beside the served estimate: each failure is logged and said, and stops nobody."""

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from models.errors import CheckpointError
from models.reasons import Reason
from models.recalibration import Lack
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
        try:
            return make()
        except CheckpointError as error:
            fields = {"camera_id": self._camera_id, "why": str(error)}
            log.warning(f"{what}_unreadable", extra=fields)
            self.add(what, "cannot be read")
        except Exception as error:
            log.exception(f"{what}_failed", extra={"camera_id": self._camera_id})
            self.add(what, repr(error))
        return None

    def take(self, found: Sequence[Lack]) -> None:
        """Say what failed beside a pose."""
        for lack in found:
            fields = {"camera_id": self._camera_id}
            log.error(f"{lack.part}_failed", exc_info=lack.error, extra=fields)
            self.add(lack.part, repr(lack.error))

    def add(self, what: str, why: str) -> None:
        """Say that something is missing, and why."""
        reason = Reason(code=ServiceCode.WITHOUT_PART, values={"part": what, "why": why})
        if reason not in self.said:
            self.said.append(reason)
