"""`GET /client.py`: the edge client, for whoever asks: it is the same in every service."""

from importlib.util import find_spec
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse

router = APIRouter(tags=["client"])


class _PythonFile(FileResponse):
    media_type = "text/x-python"


@router.get("/client.py", response_class=_PythonFile)
def get_client() -> FileResponse:
    """Get the client module.

    It posts tracks and needs only the Python standard library.
    """
    spec = find_spec("surefoot")  # which imports nothing of it: numpy is not for this process
    assert spec is not None
    assert spec.submodule_search_locations
    return _PythonFile(Path(spec.submodule_search_locations[0]) / "client.py")
