"""Templates, files and headers of pages: scripts and styles come from this host alone."""

import gzip
import hashlib
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Header, Request
from fastapi.responses import HTMLResponse, Response
from fastapi.staticfiles import StaticFiles
from fastapi.templating import Jinja2Templates
from starlette.types import Scope

from service.wording import language

_WEB = Path(__file__).parents[2] / "pages"
_STATIC = _WEB / "static"
_MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css"}
_LARGE = 16_384  # bytes; a phone far away gets larger pages packed
# No other host, no inline script, no inline style, no frame: a name that was typed is never run.
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "Referrer-Policy": "same-origin",
    "Vary": "Accept-Encoding, Accept-Language, Cookie",
}


# Of answers with an ETag that are asked for again and again: kept by the browser alone, and not
# used without asking.
REVALIDATED = {"Cache-Control": "private, no-cache"}
# Of what has a version in its path.
_FOR_EVER = {"Cache-Control": "public, max-age=31536000, immutable"}


_PACKAGED: dict[str, tuple[str, str]] = {}  # files of installed packages, by URL


def _url_of(package: str, name: str) -> str:
    path = Path(name)
    url = f"/ui/{path.stem}-{version(package)}{path.suffix}"
    _PACKAGED[url] = package, name
    return url


# Of the viewer the files alone; none of its code is run.
VIEWER_SCRIPT_URL = _url_of("fastapi_swagger", "resources/swagger-ui-bundle.js")
VIEWER_STYLE_URL = _url_of("fastapi_swagger", "resources/swagger-ui.css")


def _fingerprint() -> str:
    """A name for the static files as they are, so that browsers may keep them for ever."""
    digest = hashlib.sha256()
    for path in sorted(_STATIC.rglob("*")):
        if path.is_file():
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


STATIC_URL = f"/ui/static/{_fingerprint()}"
templates = Jinja2Templates(directory=_WEB / "templates")
templates.env.add_extension("jinja2.ext.i18n")
templates.env.install_gettext_callables(  # type: ignore[attr-defined]
    language.gettext, language.ngettext, newstyle=True
)
templates.env.globals |= {
    "static": STATIC_URL,
    "languages": language.LANGUAGES,
    "number": language.number,
    "script_words": language.script_words,
    "spoken": language.spoken,
}
templates.env.trim_blocks = templates.env.lstrip_blocks = True


class _KeptFiles(StaticFiles):
    """Static files under a path that changes with them; modules import each other beside it."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers.update(_FOR_EVER)
        return response


def mount_static(app: FastAPI) -> None:
    """Serve what pages need besides themselves."""
    app.mount(STATIC_URL, _KeptFiles(directory=_STATIC), name="static")
    for url in _PACKAGED:
        app.add_api_route(url, _packaged_file, include_in_schema=False)


def wants_page(request: Request) -> bool:
    """True where somebody looks for a page in a browser, not a program for an answer."""
    looks = request.method == "GET" and request.url.path.startswith("/ui/")
    return looks and "text/html" in request.headers.get("accept", "")


def render(request: Request, template: str, status: int = 200, **context: Any) -> HTMLResponse:
    """A page, or a part of one, out of a template; everything in it is escaped."""
    headers = {**HEADERS, "Content-Language": language.spoken()}
    page = templates.TemplateResponse(
        request, template, context, status_code=status, headers=headers
    )
    if len(page.body) > _LARGE and "gzip" in request.headers.get("accept-encoding", ""):
        page.body = gzip.compress(page.body, compresslevel=4)
        page.headers["Content-Encoding"] = "gzip"
        page.headers["Content-Length"] = str(len(page.body))
    return page


def _packaged_file(request: Request, accept_encoding: Annotated[str, Header()] = "") -> Response:
    """A file of an installed package, packed where the browser takes that."""
    path = _path(*_PACKAGED[request.url.path])
    headers = {**_FOR_EVER, "Vary": "Accept-Encoding"}
    packed = "gzip" in accept_encoding
    if packed:
        headers["Content-Encoding"] = "gzip"
    body = _packed(path) if packed else path.read_bytes()
    return Response(body, media_type=_MEDIA_TYPES[path.suffix], headers=headers)


def _path(module: str, name: str) -> Path:
    # Found without importing the package, which may be large.
    spec = find_spec(module)
    assert spec is not None
    assert spec.submodule_search_locations
    return Path(spec.submodule_search_locations[0]) / name


@lru_cache(maxsize=4)
def _packed(path: Path) -> bytes:
    return gzip.compress(path.read_bytes(), 6, mtime=0)
