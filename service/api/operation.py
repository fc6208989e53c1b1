"""`/healthz` and `/readyz`."""

from fastapi import APIRouter, Response

from service.api.middleware.dependencies import CallerDep, StateDep
from service.api.middleware.reach import auth_on
from service.api.schemas.operation import HealthOut, ReadyOut
from service.enums import Health
from service.operations.health import check_readiness

router = APIRouter(tags=["operation"])


@router.get("/healthz")
async def health() -> HealthOut:
    """Whether the process answers; no thread and no connection is needed for it."""
    return HealthOut(status=Health.OK)


@router.get("/readyz", responses={503: {"model": ReadyOut}})
def ready(state: StateDep, caller: CallerDep, response: Response) -> ReadyOut:
    """Whether the store can be written, a worker is alive and the queue keeps up."""
    readiness = check_readiness(state.store, state.settings)
    if not readiness.ready:
        response.status_code = 503
    body = ReadyOut.from_value(readiness)
    if auth_on(state.settings) and caller is None:
        body.problems = []  # they name cameras and files
    return body
