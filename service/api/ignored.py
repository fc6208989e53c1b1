"""Unknown fields of bodies, which newer clients send: named in the answer, and refused nowhere."""

import json
from collections.abc import Callable, Coroutine
from contextvars import ContextVar
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from service.formats.batch import MOST_IGNORED, brief_name

# Of the request that is answered; it comes into the route's thread with its context.
_names: ContextVar[list[str] | None] = ContextVar("ignored", default=None)


def note_ignored(names: list[str]) -> None:
    """Note a body's unknown fields, and those of bodies within it, which were noted before it."""
    if (noted := _names.get()) is not None:
        noted[:] = map(brief_name, names[:MOST_IGNORED])


class NamingRoute(APIRoute):
    """A route whose answer, a JSON object, has `ignored` where its body had unknown fields."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The declared handler, which answers with their names, too."""
        declared = super().get_route_handler()

        async def handle(request: Request) -> Response:
            names: list[str] = []
            token = _names.set(names)
            try:
                answer = await declared(request)
            finally:
                _names.reset(token)
            if names and answer.media_type == "application/json":
                content = json.loads(bytes(answer.body)) | {"ignored": names}
                text = json.dumps(content, ensure_ascii=False, separators=(",", ":"))
                answer.body = text.encode(errors="replace")
                answer.headers["content-length"] = str(len(answer.body))
            return answer

        return handle
