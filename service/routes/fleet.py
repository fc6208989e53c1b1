"""`/`: the fleet page."""

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.recalibration import operation
from service.routes.pages import render
from service.routes.state import ReadDep

router = APIRouter(include_in_schema=False)


@router.get("/")
def show(request: Request, session: ReadDep) -> HTMLResponse:
    """Every camera, what needs a person first."""
    return render(request, "fleet.html", newest_event=operation.newest_event_id(session))
