"""Answers of `/healthz` and `/readyz`."""

from typing import Self

from pydantic import BaseModel

from service.enums import Health, Readiness
from service.operations import health


class HealthOut(BaseModel):
    """The process answers."""

    status: Health


class ReadyOut(BaseModel):
    """Whether the service can do its work; some problems are named while it can."""

    status: Readiness
    store_writable: bool
    worker_alive: bool
    worker_silent_s: float | None
    queue_lag_s: float
    failing_cameras: int
    problems: list[str]

    @classmethod
    def from_value(cls, value: health.Readiness) -> Self:
        """The body of a readiness check."""
        return cls(
            status=Readiness.READY if value.ready else Readiness.NOT_READY,
            store_writable=value.store_writable,
            worker_alive=value.worker_alive,
            worker_silent_s=value.worker_silent_s,
            queue_lag_s=value.queue_lag_s,
            failing_cameras=value.failing_cameras,
            problems=list(value.problems),
        )
