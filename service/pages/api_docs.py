"""`/docs`: the operations of the API, to read and to try, without asking any other host."""

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.api.middleware.pages import VIEWER_SCRIPT_URL, VIEWER_STYLE_URL, render

router = APIRouter(include_in_schema=False)


@router.get("/docs")
def show(request: Request) -> HTMLResponse:
    """Swagger UI over `/openapi.json`."""
    return render(
        request,
        "api_docs.html",
        description_url=request.app.openapi_url,
        script_url=VIEWER_SCRIPT_URL,
        style_url=VIEWER_STYLE_URL,
    )
