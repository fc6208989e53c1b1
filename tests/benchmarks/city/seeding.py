"""Cameras by the thousand, whose references are ready, on a PostgreSQL server."""

from datetime import UTC, datetime
from pathlib import Path

from service.commands.migrate import migrate
from service.settings import Settings
from service.store.engines.files import connected
from tests.benchmarks.parts.cloned import clone
from tests.conftest import CAMERA
from tests.running import RunningService, free_port

_READY = (
    "UPDATE site_references SET ready_at = ?, to_s = ?, tracks = 200, data = x'00', "
    "walking_speed_mps = 1.3"
)
_LEARNED_S = 3 * 86_400.0  # ago


def camera_id(number: int) -> str:
    """The id of a camera, by its number."""
    return "first" if number == 0 else f"city-{number}"


def seed_file(folder: Path, cameras: int) -> Path:
    """An SQLite file with so many cameras, to be moved to a server; nobody has walked there yet."""
    settings = Settings(data_dir=folder, port=free_port(), workers=0, trainings="off")
    migrate(settings)
    service = RunningService(settings, forked=False)
    service.start()
    try:
        body = {**CAMERA, "id": camera_id(0), "reference_tracks": 200}
        service.http.post("/cameras", json=body).raise_for_status()
    finally:
        service.stop()
    now = datetime.now(UTC)
    with connected(settings.database_path) as connection:
        said = now.strftime("%Y-%m-%d %H:%M:%S.%f")
        connection.execute(_READY, (said, now.timestamp() - _LEARNED_S))
        connection.execute("DELETE FROM trainings")
    clone(settings.database_path, [camera_id(0)], [camera_id(n) for n in range(1, cameras)])
    return settings.database_path
