"""The language of a page: the one that somebody chose here, else what their browser asks for."""

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from service.wording.language import ENGLISH, LANGUAGES, speaking

COOKIE = "surefoot_language"


class LanguageMiddleware:
    """Has pages, and what their scripts ask for under `/ui/`, said in the reader's language.

    Whatever programs read is English.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        if scope["type"] == "http" and (scope["path"] == "/" or scope["path"].startswith("/ui/")):
            with speaking(language_of(Request(scope))):
                await self._app(scope, receive, send)
        else:
            await self._app(scope, receive, send)


def language_of(request: Request) -> str:
    """The language for whom a request comes from."""
    chosen = request.cookies.get(COOKIE)
    wanted = [chosen] if chosen else _preferred(request.headers.get("accept-language", ""))
    return next((each for each in wanted if each in LANGUAGES), ENGLISH)


def _preferred(header: str) -> list[str]:
    """The languages of an Accept-Language, those first that are wanted most."""
    weights: dict[str, float] = {}
    for part in header.split(","):
        tag, _, weight = part.strip().lower().partition(";q=")
        try:
            weights.setdefault(tag.partition("-")[0], float(weight or 1))
        except ValueError:
            continue  # somebody's slip refuses no page
    wanted = {name: weight for name, weight in weights.items() if weight > 0}
    return sorted(wanted, key=lambda name: -wanted[name])
