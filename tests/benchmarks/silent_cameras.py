"""How the service fares beside cameras and callers that hold what they get.

    python -m tests.benchmarks.silent_cameras [--only aims,images,rounds,streams] [--limit-s 40]

All servers listen on 127.0.0.1. A silent camera accepts connections and never answers.

- `aims`: share of posted tracks that get a 503 while twelve aims wait for silent cameras.
- `images`: the same while forty images that are expensive to decode are sent.
- `rounds`: seconds until a live camera is asked for its image beside forty silent ones.
- `streams`: whether an admin gets an event stream beside 200 that one `read` token opens.

Exits with 1 beyond the limits.
"""

import argparse
import json
import socket
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import httpx

from service.access import tokens
from service.access.tokens import TokenSpec
from service.commands.migrate import migrate
from service.settings import Settings
from service.store import cameras
from service.store.engines.store import Store
from service.store.pictures import PictureReferenceRecord
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port
from tests.service.cameras.test_snapshots import scans

AIMS, IMAGES, SILENT, STREAMS, POSTERS = 12, 40, 40, 200, 5
POSTS_S = 6.0
MOST_REFUSED, LIVE_WITHIN_S = 0.0, 30.0


def silent_camera(stack: ExitStack) -> tuple[socket.socket, str]:
    """A socket that the kernel accepts connections for and that never answers, and its URL."""
    listening = stack.enter_context(closing(socket.create_server(("127.0.0.1", 0), backlog=64)))
    return listening, f"http://127.0.0.1:{listening.getsockname()[1]}/now.jpg"


@contextmanager
def service(**changes: Any) -> Iterator[RunningService]:
    """A service that takes images, over an empty data directory."""
    with tempfile.TemporaryDirectory(prefix="surefoot-silent-") as folder:
        given = {"workers": 0, "snapshots": "features", "snapshot_allow": "127.0.0.0/8"}
        settings = Settings(
            data_dir=Path(folder) / "data",
            port=free_port(),
            trainings="off",
            caller_rate=0,
            camera_rate=0,
            **{**given, **changes},  # type: ignore[arg-type]
        )
        migrate(settings)
        running = RunningService(settings)
        running.start()
        try:
            yield running
        finally:
            running.stop()


def register(running: RunningService, camera_id: str, url: str | None = None) -> None:
    """Register a camera, with the address of its image if there is one."""
    body = {**CAMERA, "id": camera_id, "snapshot_url": url}
    running.http.post("/cameras", json=body).raise_for_status()


def posts_beside(running: RunningService, busy: list[Callable[[], object]]) -> Counter[int]:
    """Status codes of the tracks that are posted while other requests are under way."""
    statuses: Counter[int] = Counter()
    register(running, "posting")
    with ThreadPoolExecutor(len(busy) + POSTERS) as pool:
        for each in busy:
            pool.submit(each)
        time.sleep(0.5)
        end_s = time.monotonic() + POSTS_S

        def post(name: int) -> None:
            with httpx.Client(base_url=running.url, timeout=30) as http:
                number = 0
                while time.monotonic() < end_s:
                    number += 1
                    body = {"tracks": [track(f"{name}-{number}")]}
                    statuses[http.post("/cameras/posting/tracks", json=body).status_code] += 1

        for each in [pool.submit(post, name) for name in range(POSTERS)]:
            each.result()
    return statuses


def refused(statuses: Counter[int]) -> float:
    """The share of a 503."""
    return statuses[503] / max(statuses.total(), 1)


def aims(stack: ExitStack) -> tuple[dict[str, Any], bool]:
    """Post tracks while twelve aims wait for silent cameras."""
    running = stack.enter_context(service())
    with closing(Store(running.settings)) as store:
        for number in range(AIMS):
            register(running, f"aim-{number}", silent_camera(stack)[1])
            with store.write() as session:
                prior = cameras.prior_pose(session, f"aim-{number}")
                session.add(
                    PictureReferenceRecord(
                        camera_id=f"aim-{number}", prior_pose_id=prior.id, features=b"unread"
                    )
                )

    def aim(number: int) -> None:
        end_s = time.monotonic() + POSTS_S
        while time.monotonic() < end_s:
            httpx.post(f"{running.url}/cameras/aim-{number}/aim", timeout=30)
            time.sleep(1)  # as the page does

    statuses = posts_beside(running, [lambda number=n: aim(number) for n in range(AIMS)])  # type: ignore[misc]
    return {"posts": statuses, "refused": refused(statuses)}, refused(statuses) <= MOST_REFUSED


def images(stack: ExitStack) -> tuple[dict[str, Any], bool]:
    """Post tracks while forty images are sent that take their reader all of its CPU time."""
    running = stack.enter_context(service())
    heavy = scans(2560, 1440, 12_000)
    for number in range(IMAGES):
        register(running, f"image-{number}")

    def put(number: int) -> None:
        url = f"{running.url}/cameras/image-{number}/snapshot"
        httpx.put(url, content=heavy, headers={"Content-Type": "image/jpeg"}, timeout=60)

    statuses = posts_beside(running, [lambda number=n: put(number) for n in range(IMAGES)])  # type: ignore[misc]
    return {"posts": statuses, "refused": refused(statuses)}, refused(statuses) <= MOST_REFUSED


def rounds(stack: ExitStack, limit_s: float) -> tuple[dict[str, Any], bool]:
    """Wait until a live camera is asked for its image, registered after forty silent ones."""
    live, url = silent_camera(stack)
    live.settimeout(limit_s)
    running = stack.enter_context(service(workers=1))
    for number in range(SILENT):
        register(running, f"silent-{number:02}", silent_camera(stack)[1])
    begun_s = time.monotonic()
    register(running, "z-live", url)
    try:
        live.accept()[0].close()
    except TimeoutError:
        return {"asked_after_s": f"not within {limit_s:g}"}, False
    waited_s = time.monotonic() - begun_s
    return {"asked_after_s": round(waited_s, 1)}, waited_s <= LIVE_WITHIN_S


def streams(stack: ExitStack) -> tuple[dict[str, Any], bool]:
    """Ask for an event stream as an admin, beside those that one `read` token has opened."""
    running = stack.enter_context(service(auth="off"))
    with closing(Store(running.settings)) as store, store.write() as session:
        reader, admin = (
            tokens.make_token(session, TokenSpec(name=scope, scopes=(scope,)), None).text
            for scope in ("read", "admin")
        )
    running.start_again(auth="on")

    def ask(token: str) -> int:
        made = stack.enter_context(
            closing(socket.create_connection(("127.0.0.1", running.settings.port), timeout=10))
        )
        head = f"GET /events HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\r\n"
        made.sendall(head.encode())
        return int(made.recv(65536).split()[1])

    opened = Counter(ask(reader) for _ in range(STREAMS))
    answer = ask(admin)
    return {"of_the_reader": opened, "of_the_admin": answer}, answer == 200


def main() -> int:
    """Run the attacks that are asked for; print what each measured."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--only", default="aims,images,rounds,streams", help="names, with commas")
    asked.add_argument("--limit-s", type=float, default=40.0, help="longest wait of `rounds`")
    wanted = asked.parse_args()
    attacks: dict[str, Callable[[ExitStack], tuple[dict[str, Any], bool]]] = {
        "aims": aims,
        "images": images,
        "rounds": lambda stack: rounds(stack, wanted.limit_s),
        "streams": streams,
    }
    held = True
    for name in wanted.only.split(","):
        with ExitStack() as stack:
            found, well = attacks[name](stack)
        held &= well
        sys.stdout.write(json.dumps({"attack": name, "held": well, **found}) + "\n")
        sys.stdout.flush()
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
