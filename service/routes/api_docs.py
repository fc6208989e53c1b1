"""`/docs`: the operations of the API, to read and to try, without asking any other host."""

from typing import Annotated

from fastapi import APIRouter, Header, Request
from fastapi.responses import HTMLResponse, Response

from service.routes.packaged import packaged_file, versioned_url
from service.routes.pages import render

router = APIRouter(include_in_schema=False)

_PACKAGE, _MODULE = "fastapi-swagger", "fastapi_swagger"  # its files alone; none of its code is run
_SCRIPT, _STYLE = "resources/swagger-ui-bundle.js", "resources/swagger-ui.css"
VIEWER_SCRIPT_URL = versioned_url(_PACKAGE, _SCRIPT)
VIEWER_STYLE_URL = versioned_url(_PACKAGE, _STYLE)


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
    return packaged_file(_MODULE, _SCRIPT, accept_encoding)


@router.get(VIEWER_STYLE_URL)
def style(accept_encoding: Annotated[str, Header()] = "") -> Response:
    """The viewer's style, out of its installed package."""
    return packaged_file(_MODULE, _STYLE, accept_encoding)
