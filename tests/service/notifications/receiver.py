"""A real HTTP server that takes messages, answers as it is told, and remembers everything."""

import json
import ssl
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from standardwebhooks import Webhook


@dataclass
class Received:
    path: str
    headers: dict[str, str]
    body: str

    @property
    def json(self) -> Any:
        return json.loads(self.body)

    def verified(self, secret: str) -> Any:
        """What the library's own check gives; it raises where the signature is not right."""
        return Webhook(secret).verify(self.body, self.headers)


@dataclass
class Receiver:
    """Answers in turn; the last answer stays. An answer: a status, headers, and a wait."""

    url: str = ""
    answers: list[tuple[int, dict[str, str], float]] = field(default_factory=list)
    received: list[Received] = field(default_factory=list)

    def answer(self, *answers: int | tuple[int, dict[str, str]], wait_s: float = 0.0) -> None:
        self.answers = [
            (answer, {}, wait_s) if isinstance(answer, int) else (*answer, wait_s)
            for answer in answers
        ]

    def next_answer(self) -> tuple[int, dict[str, str], float]:
        if not self.answers:
            return 204, {}, 0.0
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def ids(self) -> list[str]:
        return [message.headers["webhook-id"] for message in self.received]

    def types(self) -> list[str]:
        return [message.json["type"] for message in self.received]

    def deduped(self) -> Sequence[Received]:
        """As a receiver that heeds `webhook-id` sees it."""
        return list({message.headers["webhook-id"]: message for message in self.received}.values())


@contextmanager
def receiver(tls: ssl.SSLContext | None = None) -> Iterator[Receiver]:
    """A receiver on a free port of the loopback address."""
    state = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            length = int(self.headers["Content-Length"])
            body = self.rfile.read(length).decode()
            if len(body.encode()) < length:
                return  # who sent it was killed in the midst: there is nobody to answer
            headers = {name.lower(): value for name, value in self.headers.items()}
            state.received.append(Received(self.path, headers, body))
            status, extra, wait_s = state.next_answer()
            time.sleep(wait_s)
            self.send_response(status)
            for name, value in extra.items():
                self.send_header(name, value)
            self.end_headers()
            if status >= 300:
                self.wfile.write(b"no, not now")

        def log_message(self, *args: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.handle_error = lambda *_: None  # a client that hangs up is part of the test
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True)
    state.url = f"http://127.0.0.1:{server.server_port}/hook"
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
