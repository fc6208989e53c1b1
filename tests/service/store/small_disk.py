"""A service on a disk that fills up, and that becomes read-only: `test_small_disk.py` runs this.

In a mount namespace of its own: `unshare -m python -m tests.service.store.small_disk
MIGRATED FOLDER`.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from tests.conftest import CAMERA, track


def answer_of(client: TestClient, method: str, path: str, **more: Any) -> list[Any]:
    """Status, code and Retry-After of an answer, and what it says."""
    answer = client.request(method, path, **more)
    document = answer.json()
    code = document.get("code") if isinstance(document, dict) else None
    return [answer.status_code, code, answer.headers.get("retry-after"), answer.text[:400]]


def post(client: TestClient, number: int) -> list[Any]:
    """Post twenty tracks."""
    tracks = [track(f"{number}-{n}") for n in range(20)]
    return answer_of(client, "POST", "/cameras/corner/tracks", json={"tracks": tracks})


def main() -> None:
    """Fill the disk, make room, make it read-only; print what was answered."""
    migrated, folder = sys.argv[1], Path(sys.argv[2])
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=10m", "tmpfs", str(folder)], check=True)
    shutil.copytree(migrated, folder / "data")
    settings = Settings(data_dir=folder / "data", min_free_mb=0)
    found: dict[str, Any] = {}
    with TestClient(create_app(settings)) as client:
        client.post("/cameras", json=CAMERA).raise_for_status()
        accepted = [post(client, number)[0] for number in range(2)].count(202)
        free = shutil.disk_usage(folder).free
        (folder / "ballast").write_bytes(os.urandom(free - 64 * 1024))
        answer = post(client, accepted)
        while answer[0] == 202:
            accepted += 1
            assert accepted < 500
            answer = post(client, accepted)
        found["full"] = answer
        # The last bytes, too.
        with contextlib.suppress(OSError), (folder / "ballast").open("ab", 0) as ballast:
            while True:
                ballast.write(bytes(4096))
        found["full_register"] = answer_of(client, "POST", "/cameras", json={**CAMERA, "id": "b"})
        found["full_ready"] = answer_of(client, "GET", "/readyz")
        found["full_health"] = answer_of(client, "GET", "/healthz")
        found["full_read"] = answer_of(client, "GET", "/cameras/corner")
        (folder / "ballast").unlink()
        found["room"] = post(client, 1000)
        found["room_ready"] = client.get("/readyz").json()
        found["accepted"] = (accepted + 1) * 20
        found["stored"] = client.get("/cameras/corner").json()["tracks"]
    with TestClient(create_app(settings.model_copy(update={"min_free_mb": 1e6}))) as client:
        found["little"] = client.get("/readyz").json()
    subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
    with TestClient(create_app(settings)) as client:
        found["read_only"] = post(client, 2000)
        found["read_only_ready"] = answer_of(client, "GET", "/readyz")
        found["read_only_health"] = answer_of(client, "GET", "/healthz")
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
