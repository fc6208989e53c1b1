"""`/healthz` and `/readyz`, and the way from `/` to the documentation."""

from fastapi import APIRouter, Response
from fastapi.responses import RedirectResponse

from service.recalibration import operation
from service.routes.state import StateDep
from service.schemas.operation import HealthOut, ReadyOut

router = APIRouter(tags=["operation"])


@router.get("/", include_in_schema=False)
def root() -> RedirectResponse:
    """To the interactive documentation, until there are pages."""
    return RedirectResponse("/docs")


@router.get("/healthz")
def health() -> HealthOut:
    """Whether the process answers."""
    return HealthOut(status="ok")


@router.get("/readyz", responses={503: {"model": ReadyOut}})
def ready(state: StateDep, response: Response) -> ReadyOut:
    """Whether the store can be written, a worker is alive and the queue keeps up."""
    readiness = operation.check_readiness(state.store, state.settings)
    if not readiness.ready:
        response.status_code = 503
    return ReadyOut.from_value(readiness)
