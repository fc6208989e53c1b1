"""Files that a pose passes through: those whose functions run in one look at a camera.

    python -m tests.benchmarks.look_files

Counted by the interpreter's profile of the estimate job, from its start to the stored pose and on
to `GET /cameras/{id}/pose`; compiled loops are counted by the files that call them.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

from fastapi.testclient import TestClient

from service.app import create_app
from service.commands.migrate import migrate
from service.settings import Settings
from tests.conftest import CAMERA, ROOT
from tests.service.street import KNOCKED, PRIOR, Street

SHIPPED = ("surefoot", "models", "service")


def main() -> None:
    """Print each room's files of one look after a knock, and how many there are."""
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(data_dir=Path(folder) / "data")
        migrate(settings)
        with TestClient(create_app(settings)) as http:
            http.post("/cameras", json={**CAMERA, "reference_tracks": 100}).raise_for_status()
            street = Street(http, settings)
            street.keep_to_lanes(PRIOR, 100)
            street.look()
            street.keep_to_lanes(KNOCKED, 40)
            street.look()
            street.keep_to_lanes(KNOCKED, 5)
            names = files_of_a_look(street)
            street.close()
    rooms = Counter("/".join(name.split("/")[:2]) for name in names)
    for room, count in sorted(rooms.items()):
        sys.stdout.write(f"{count:4} {room}\n")
    sys.stdout.write(f"{len(names):4} files in all\n")


def files_of_a_look(street: Street) -> set[str]:
    """The project's files that ran, from the root."""
    found: set[str] = set()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            found.add(frame.f_code.co_filename)

    from service.workers.estimate import run_estimate

    sys.setprofile(note)
    try:
        run_estimate(street.context, "corner")
    finally:
        sys.setprofile(None)
    inside = [Path(name).relative_to(ROOT) for name in found if name.startswith(f"{ROOT}/")]
    return {str(path) for path in inside if path.parts[0] in SHIPPED}


if __name__ == "__main__":
    main()
