"""Problem documents (RFC 9457) for all errors; a page for who looks for a page."""

import json
import logging
from http import HTTPStatus
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from sqlalchemy.exc import SQLAlchemyError
from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from models.errors import CalibrationError
from service.api.middleware import pages
from service.errors import FieldError, ServiceError
from service.store.engines.failures import failure_of
from service.wording.body_errors import field_errors
from service.wording.language import N_, _

log = logging.getLogger("surefoot.http")

FORESEEN = (
    ServiceError,
    SQLAlchemyError,
    CalibrationError,
    RequestValidationError,
    HTTPException,
)
# Nothing of ours shows in a page of another origin, and no browser guesses at a type: JSON with
# text that a tracker made up is no page.
_OF_ALL = {"X-Content-Type-Options": "nosniff", "Cross-Origin-Resource-Policy": "same-origin"}
# The default of every route: no browser and no proxy stores the answer.
_NOT_STORED = "no-store"
# What a person can do about what a program reads in the detail.
_FOR_PEOPLE = {
    403: N_(
        "You may look, but not do this. Whoever looks after the service can give you the right."
    )
}
_TITLES = {
    403: N_("Forbidden"),
    404: N_("Not found"),
    500: N_("The service failed"),
    503: N_("The service is busy"),
}  # of pages
_MOST_ERRORS = 20  # of one body


class ProblemMiddleware:
    """Answers what nobody foresaw, or what other middlewares raise, with a problem document.

    It sees every answer, and adds headers: no browser guesses its type, and none stores it unless
    its route allows that.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and answer for it where it fails."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun = False

        async def noting(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                headers = MutableHeaders(scope=message)
                headers.update(_OF_ALL)
                # FastAPI's streams of events have "no-cache", which allows to store them.
                if headers.get("cache-control", "no-cache") == "no-cache":
                    headers["Cache-Control"] = _NOT_STORED
            await send(message)

        try:
            await self._app(scope, receive, noting)
        except ClientDisconnect:
            return
        except Exception as error:
            if begun:
                raise
            answer = await answer_of(Request(scope, receive), error)
            await answer(scope, receive, noting)


def problem(request: Request, error: ServiceError) -> Response:
    """The answer that tells of an error; nothing in it can keep it from being sent."""
    status, title = error.status, HTTPStatus(error.status).phrase
    request.scope["surefoot_problem"] = error.code  # for the count of refusals
    headers = error.headers
    if error.retry_after_s is not None:
        headers["Retry-After"] = str(max(1, round(error.retry_after_s)))
    if pages.wants_page(request):
        said = _(_FOR_PEOPLE[status]) if status in _FOR_PEOPLE else error.detail
        title = _(_TITLES.get(status, title))
        page = pages.render(request, "problem.html", status, title=title, detail=said)
        page.headers.update(headers)
        return page
    content: dict[str, Any] = {
        "type": "about:blank",
        "title": title,
        "status": status,
        "code": error.code,
        "detail": error.detail,
    }
    if error.errors:
        content["errors"] = [
            {"pointer": item.pointer, "reason": item.reason} for item in error.errors
        ]
    if "ETag" in headers:
        content["etag"] = headers["ETag"]  # in the body, too: a person copies it from there
    # Text may hold half a surrogate pair, which came as one of JSON's escapes.
    text = json.dumps(content, ensure_ascii=False).encode("utf-8", errors="replace")
    return Response(text, status, headers, media_type="application/problem+json")


async def answer_of(request: Request, error: Exception) -> Response:
    """The answer that tells of what was raised.

    A coroutine: a plain handler would need a thread, of which there may be none.
    """
    answer = problem(request, _told(request, error))
    if isinstance(error, HTTPException):
        answer.headers.update(error.headers or {})
    return answer


def _told(request: Request, error: Exception) -> ServiceError:
    """The error as clients are told of it; one that nobody foresaw is logged."""
    match error:
        case ServiceError():
            return error
        case SQLAlchemyError() if found := failure_of(error):
            return found
        case CalibrationError():
            return _other(409, "calibration", str(error))
        case RequestValidationError():
            return _malformed(error)
        case HTTPException(status_code=status, detail=detail):
            code = HTTPStatus(status).phrase.lower().replace(" ", "_")
            return _other(status, code, str(detail))
    fields = {"method": request.method, "path": request.url.path}
    log.error("request_failed", exc_info=error, extra=fields)
    return ServiceError("the service failed; its log says where")


def _malformed(error: RequestValidationError) -> ServiceError:
    errors = field_errors(error.errors()[:_MOST_ERRORS])
    detail = "; ".join(f"{item.pointer[1:] or 'body'}: {item.reason}" for item in errors)
    return _other(422, "malformed", detail, errors)


def _other(
    status: int, code: str, detail: str, errors: tuple[FieldError, ...] = ()
) -> ServiceError:
    error = ServiceError(detail, errors)
    error.status, error.code = status, code
    return error
