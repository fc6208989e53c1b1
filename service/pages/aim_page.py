"""`/ui/cameras/{id}/aim`: a phone's page for who stands on the ladder."""

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.cameras.cameras import view_camera

router = APIRouter(include_in_schema=False)


@router.get("/ui/cameras/{camera_id}/aim")
def show(camera_id: str, request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """An arrow, how far, green once it looks where it did; and that it was put back."""
    return render(request, "aim.html", camera=view_camera(session, state.settings, camera_id))
