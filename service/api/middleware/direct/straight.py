"""Routes that answer the plain one among their requests without FastAPI's reading of it.

What a route declares is what is documented, and how a request with a query is read. To work that
out anew for a path and nothing else is a good part of what a small request costs.
"""

from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, TypeVar

from fastapi import Request, Response
from fastapi.routing import APIRoute

Answer = Callable[[Request], Awaitable[Response]]
Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])
_MARK = "surefoot_straight"


def straight(answer: Answer) -> Callable[[Endpoint], Endpoint]:
    """Have a route's requests without a query answered by a function, as the route would."""

    def marked(endpoint: Endpoint) -> Endpoint:
        setattr(endpoint, _MARK, answer)
        return endpoint

    return marked


class StraightRoute(APIRoute):
    """A route whose endpoint may be marked as `straight`."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """What answers a request."""
        declared = super().get_route_handler()
        plain: Answer | None = getattr(self.endpoint, _MARK, None)
        if plain is None:
            return declared

        async def answer(request: Request) -> Response:
            return await (declared if request.scope["query_string"] else plain)(request)

        return answer
