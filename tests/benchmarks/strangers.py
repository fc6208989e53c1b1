"""Who is answered while 1,000 strangers log in slowly: `python -m tests.benchmarks.strangers`.

They come from four addresses and say `--rate` bytes a second each; meanwhile new connections ask
for `/healthz` without a token and for `/cameras` with one, and post bodies of 0.9 MB.
With SUREFOOT_TEST_DATABASE=postgresql it runs on a server of its own.
"""

import argparse
import collections
import selectors
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path

import httpx

from service.access import tokens
from service.access.tokens import TokenSpec
from service.store.engines.store import Store
from tests.benchmarks.bodies import SIZE, honest
from tests.conftest import CAMERA
from tests.running import RunningService, free_port
from tests.stores import databases

_HEAD = (
    b"POST /ui/login HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n"
    b"Content-Type: application/x-www-form-urlencoded\r\n\r\ntoken="
)
_ADDRESSES = 4


def flood(port: int, strangers: int, size: int, rate: int, until: threading.Event) -> None:
    """Keep so many slow logins open, each as large as it says; who is cut comes again."""
    open_ones: dict[int, socket.socket] = {}
    while not until.wait(0.5):
        for number in range(strangers):
            try:
                if number not in open_ones:
                    made = socket.socket()
                    made.bind((f"127.0.0.{2 + number % _ADDRESSES}", 0))
                    made.setblocking(False)
                    made.connect_ex(("127.0.0.1", port))
                    selector = selectors.DefaultSelector()
                    selector.register(made, selectors.EVENT_WRITE)
                    selector.select(0.01)
                    selector.close()
                    made.send(_HEAD % size)
                    open_ones[number] = made
                open_ones[number].send(b"x" * (rate // 2))
            except OSError:
                if (gone := open_ones.pop(number, None)) is not None:
                    gone.close()


def main() -> None:
    """Print how often each was answered how."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strangers", type=int, default=1_000)
    parser.add_argument("--size", type=int, default=1_000_000, help="of a login that never ends")
    parser.add_argument("--rate", type=int, default=2_048)
    parser.add_argument("--seconds", type=float, default=40.0)
    asked = parser.parse_args()
    values = {"workers": 0, "port": free_port(), "auth": "on"}
    with (
        tempfile.TemporaryDirectory() as folder,
        databases.fresh(Path(folder), **values) as settings,
    ):
        with Store(settings).write() as session:
            spec = TokenSpec(name="ada", scopes=("admin", "ingest"))
            bearer = {"Authorization": f"Bearer {tokens.make_token(session, spec, None).text}"}
        running = RunningService(settings)
        running.start()
        httpx.post(f"{running.url}/cameras", json={**CAMERA, "id": "c0"}, headers=bearer)
        until, said = threading.Event(), collections.Counter[tuple[str, str]]()
        strangers = threading.Thread(
            target=flood, args=(settings.port, asked.strangers, asked.size, asked.rate, until)
        )
        strangers.start()
        time.sleep(5)
        body, end_s, longest_s = (
            honest()[: SIZE // 35] + b"]}]}",
            time.monotonic() + asked.seconds,
            0.0,
        )
        while time.monotonic() < end_s:
            for name, method, path, content in (
                ("/healthz", "GET", "/healthz", None),
                ("/cameras with a token", "GET", "/cameras", None),
                ("a post of 0.9 MB with a token", "POST", "/cameras/c0/tracks", content_of(body)),
            ):
                begun_s = time.monotonic()
                headers = {"Content-Type": "application/json"}
                headers |= {} if path == "/healthz" else bearer
                try:
                    answer = httpx.request(
                        method, f"{running.url}{path}", content=content, headers=headers, timeout=30
                    )
                    said[name, str(answer.status_code)] += 1
                except httpx.HTTPError as error:
                    said[name, type(error).__name__] += 1
                longest_s = max(longest_s, time.monotonic() - begun_s)
            time.sleep(0.3)
        until.set()
        strangers.join()
        running.kill()
    for (name, answer), count in sorted(said.items()):
        sys.stdout.write(f"{name}: {answer} {count} times\n")
    sys.stdout.write(f"longest {longest_s:.2f} s\n")


def content_of(body: bytes) -> bytes:
    """A whole body of what was cut off in the middle of a track."""
    return body[: body.rindex(b"]},", 0, len(body) - 4)] + b"]}]}"


if __name__ == "__main__":
    main()
