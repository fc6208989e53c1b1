"""`/healthz` and `/readyz`."""

from dataclasses import asdict
from typing import Self

from fastapi import APIRouter, Response
from pydantic import BaseModel

from service.api.middleware.dependencies import CallerDep, StateDep
from service.api.middleware.hosts import auth_on
from service.enums import Health, Readiness
from service.operations import health as checks


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
    def from_value(cls, value: checks.Readiness) -> Self:
        """The body of a readiness check."""
        status = Readiness.READY if value.ready else Readiness.NOT_READY
        return cls.model_validate({**asdict(value), "status": status})


router = APIRouter(tags=["operation"])


@router.get("/healthz")
async def health() -> HealthOut:
    """Whether the process answers; no thread and no connection is needed for it."""
    return HealthOut(status=Health.OK)


@router.get("/readyz", responses={503: {"model": ReadyOut}})
def ready(state: StateDep, caller: CallerDep, response: Response) -> ReadyOut:
    """Whether the store can be written, a worker is alive and the queue keeps up."""
    readiness = checks.check_readiness(state.store, state.settings)
    if not readiness.ready:
        response.status_code = 503
    body = ReadyOut.from_value(readiness)
    if auth_on(state.settings) and caller is None:
        body.problems = []  # they name cameras and files
    return body
