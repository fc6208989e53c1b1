"""`/docs`: the operations of the API, to read and to try, without asking any other host."""

from typing import Annotated

from fastapi import APIRouter, Header, Request
from fastapi.responses import HTMLResponse, Response

from service.api.middleware.pages import (
    VIEWER_MODULE,
    VIEWER_SCRIPT,
    VIEWER_SCRIPT_URL,
    VIEWER_STYLE,
    VIEWER_STYLE_URL,
    packaged_file,
    render,
)

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


@router.get(VIEWER_SCRIPT_URL)
def script(accept_encoding: Annotated[str, Header()] = "") -> Response:
    """The viewer's script, out of its installed package."""
    return packaged_file(VIEWER_MODULE, VIEWER_SCRIPT, accept_encoding)


@router.get(VIEWER_STYLE_URL)
def style(accept_encoding: Annotated[str, Header()] = "") -> Response:
    """The viewer's style, out of its installed package."""
    return packaged_file(VIEWER_MODULE, VIEWER_STYLE, accept_encoding)
