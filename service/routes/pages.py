"""What every page shares: templates, static files, and the headers that keep strangers out."""

import hashlib
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, Response
from fastapi.staticfiles import StaticFiles
from fastapi.templating import Jinja2Templates
from starlette.types import Scope

import service.web

_WEB = Path(service.web.__file__).parent
_STATIC = _WEB / "static"
# No other host, no inline script, no inline style, no frame: a name that was typed is never run.
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


def _fingerprint() -> str:
    """A name for the static files as they are, so that browsers may keep them for ever."""
    digest = hashlib.sha256()
    for path in sorted(_STATIC.rglob("*")):
        if path.is_file():
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


STATIC_URL = f"/ui/static/{_fingerprint()}"
templates = Jinja2Templates(directory=_WEB / "templates")
templates.env.globals["static"] = STATIC_URL
templates.env.trim_blocks = templates.env.lstrip_blocks = True


class _KeptFiles(StaticFiles):
    """Static files under a path that changes with them; modules import each other beside it."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable"
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response


def mount_static(app: FastAPI) -> None:
    """Serve what pages need besides themselves."""
    app.mount(STATIC_URL, _KeptFiles(directory=_STATIC), name="static")


def render(request: Request, template: str, status: int = 200, **context: Any) -> HTMLResponse:
    """A page, or a part of one, out of a template; everything in it is escaped."""
    return templates.TemplateResponse(
        request, template, context, status_code=status, headers=HEADERS
    )
