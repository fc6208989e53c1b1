"""Scripts and styles that browsers get out of installed packages, so from this host alone."""

import gzip
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from fastapi.responses import Response

_MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css"}


def versioned_url(package: str, name: str) -> str:
    """The path of a file of a package; the version is in it, so browsers may keep it for ever."""
    path = Path(name)
    return f"/ui/{path.stem}-{version(package)}{path.suffix}"


def packaged_file(module: str, name: str, accept_encoding: str) -> Response:
    """A file of an installed package, packed where the browser takes that."""
    path = _path(module, name)
    headers = {
        "Cache-Control": "public, max-age=31536000, immutable",
        "X-Content-Type-Options": "nosniff",
        "Vary": "Accept-Encoding",
    }
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


CHARTS = "package_data/plotly.min.js"
CHARTS_URL = versioned_url("plotly", CHARTS)


VIEWER_PACKAGE, VIEWER_MODULE = (
    "fastapi-swagger",
    "fastapi_swagger",
)  # its files alone; none of its code is run
VIEWER_SCRIPT, VIEWER_STYLE = "resources/swagger-ui-bundle.js", "resources/swagger-ui.css"
VIEWER_SCRIPT_URL = versioned_url(VIEWER_PACKAGE, VIEWER_SCRIPT)
VIEWER_STYLE_URL = versioned_url(VIEWER_PACKAGE, VIEWER_STYLE)
