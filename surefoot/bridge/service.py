"""The service as the bridge and the command line ask it: posts, states, alerts, events."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import httpx

_TIMEOUT_S = 60.0
PAGE = 1000  # of a list: no answer has more
_HEARTBEATS_S = 30.0  # three of the service's: a stream that is silent for longer is none
# Refusals that another token, or another hour, may end.
_FOR_NOW = frozenset({401, 403, 408, 429})


class LaterError(Exception):
    """No answer, or a refusal for now: to be asked again, after `wait_s` where the service says."""

    def __init__(self, reason: str, *, away: bool, wait_s: float | None = None) -> None:
        super().__init__(reason)
        self.away = away  # whatever else is asked for fares alike
        self.wait_s = wait_s


class RefusedError(Exception):
    """A refusal for good, as its problem document tells it."""

    def __init__(self, status: int, code: str, detail: str) -> None:
        super().__init__(detail)
        self.status, self.code, self.detail = status, code, detail


class Event(NamedTuple):
    """An event of the stream; `id` is what the next stream goes on from."""

    id: str
    kind: str
    data: str


class Service:
    """A client of one service, for one thread; `heard` is what a next stream goes on from."""

    def __init__(self, url: str, token: str | None, timeout_s: float = _TIMEOUT_S) -> None:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=timeout_s)
        self.heard: str | None = None

    def post_tracks(self, camera_id: str, body: bytes) -> dict[str, Any]:
        """The receipt of a post.

        Raises:
            LaterError: nothing is stored yet.
            RefusedError: nothing ever will be.
        """
        headers = {"Content-Type": "application/json"}
        return self._ask("POST", f"/cameras/{camera_id}/tracks", content=body, headers=headers)

    def get(self, path: str, **query: Any) -> dict[str, Any]:
        """The document at a path.

        Raises:
            LaterError: there is none for now.
            RefusedError: there is none.
        """
        return self._ask("GET", path, params=query)

    def items(self, path: str, **query: Any) -> Iterator[dict[str, Any]]:
        """All that a list at a path has, page after page.

        Raises:
            LaterError: there is none for now.
            RefusedError: there is none.
        """
        cursor: dict[str, str] = {}
        while True:
            page = self.get(path, limit=PAGE, **query, **cursor)
            yield from page["items"]
            if page["next_cursor"] is None:
                return
            cursor = {"cursor": page["next_cursor"]}

    def post(self, path: str, document: dict[str, Any]) -> dict[str, Any]:
        """The answer to a document.

        Raises:
            LaterError: nothing has come of it for now.
            RefusedError: nothing ever will.
        """
        return self._ask("POST", path, json=document)

    def put(self, path: str, document: dict[str, Any]) -> None:
        """Put a document at a path whose answer has no body.

        Raises:
            LaterError: it is not stored for now.
            RefusedError: it never will be.
        """
        try:
            _check(self._http.put(path, json=document))
        except httpx.RequestError as error:
            raise LaterError(f"{type(error).__name__}: {error}", away=True) from error

    def readiness(self) -> dict[str, Any]:
        """The document of `/readyz`, which is answered with 503 where the service is not ready.

        Raises:
            LaterError: there is none for now.
            RefusedError: there is none.
        """
        return self._ask("GET", "/readyz", told_by_503=True)

    def events(self, after: str | None) -> Iterator[Event | None]:
        """Events as they happen, from the one after that on; None at once and with heartbeats.

        Raises:
            LaterError: the stream has ended.
        """
        headers = {} if after is None else {"Last-Event-ID": after}
        timeout = httpx.Timeout(_TIMEOUT_S, read=_HEARTBEATS_S)
        try:
            with self._http.stream("GET", "/events", headers=headers, timeout=timeout) as answer:
                if answer.status_code != 200:
                    answer.read()
                    _check(answer)
                yield from self._parsed(answer.iter_lines())
        except httpx.RequestError as error:
            raise LaterError(f"{type(error).__name__}: {error}", away=True) from error
        raise LaterError("the stream has ended", away=True)

    def _parsed(self, lines: Iterator[str]) -> Iterator[Event | None]:
        """Server-Sent Events, as far as the service uses them; None for each comment."""
        fields: dict[str, str] = {}
        for line in lines:
            if line.startswith(":"):
                yield None
            elif line:
                name, _, value = line.partition(":")
                fields[name] = value.removeprefix(" ")
            else:
                if "data" in fields:
                    yield Event(fields.get("id", ""), fields.get("event", ""), fields["data"])
                self.heard = fields.get("id", self.heard)
                fields = {}

    def _ask(
        self, method: str, path: str, *, told_by_503: bool = False, **what: Any
    ) -> dict[str, Any]:
        try:
            answer = self._http.request(method, path, **what)
            own = answer.headers.get("content-type") == "application/json"  # no problem document
            if not (told_by_503 and answer.status_code == 503 and own):
                _check(answer)
            document: dict[str, Any] = answer.json()
        except httpx.RequestError as error:
            raise LaterError(f"{type(error).__name__}: {error}", away=True) from error
        except ValueError as error:  # a proxy's page
            raise LaterError(f"an answer that is no JSON: {error}", away=True) from error
        return document


def _document(answer: httpx.Response) -> Any:
    """The JSON of an answer; None where it has none, whatever its type says."""
    if "json" not in answer.headers.get("content-type", ""):
        return None
    try:
        return answer.json()
    except ValueError:
        return None


def _check(answer: httpx.Response) -> None:
    if answer.is_success:
        return
    status = answer.status_code
    problem = _document(answer)
    is_problem = isinstance(problem, dict)
    if not is_problem:
        problem = {}
    code, detail = problem.get("code", "unknown"), problem.get("detail", answer.text[:200])
    # What does not speak as the service does stands before it, or in its place.
    if 400 <= status < 500 and status not in _FOR_NOW and is_problem:
        raise RefusedError(status, code, detail)
    wait = answer.headers.get("retry-after", "")
    wait_s = float(wait) if wait.isdecimal() else None
    away = status != 500  # which one body alone may trip over
    raise LaterError(f"{status} {code}: {detail}", away=away, wait_s=wait_s)
